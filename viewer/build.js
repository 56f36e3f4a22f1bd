// node build.js PAGE: everything in src/ and three.js as one page that asks for nothing else.
import { build } from 'esbuild';
import { readFile, writeFile } from 'node:fs/promises';
import { fileURLToPath } from 'node:url';

const source = (name) => fileURLToPath(new URL(`src/${name}`, import.meta.url));
const page = process.argv[2];
if (!page) throw new Error('usage: node build.js PAGE');

const { outputFiles } = await build({
  entryPoints: [source('main.js'), source('style.css')],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2020',
  charset: 'utf8',
  outdir: '.',
  write: false,
});
const bundled = (extension) => outputFiles.find(({ path }) => path.endsWith(extension)).text.trim();

// As functions: "$&" in a bundle is no pattern.
const template = await readFile(source('page.html'), 'utf8');
await writeFile(
  page,
  template.replace('/* style */', () => bundled('.css')).replace('/* script */', () => bundled('.js')),
);
