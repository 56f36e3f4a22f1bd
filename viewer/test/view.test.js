// The page of bitr assemble --view, as a browser shows it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { count, launch, mask, open, overlap, picture } from './browser.js';

const folder = mkdtempSync(join(tmpdir(), 'bitr_view_'));
const inside = (name) => join(folder, name);
const bitr = (...words) => execFileSync(process.env.BITR_COMMAND, words, { encoding: 'utf8', stdio: 'pipe' });
const assemble = (source, reference, name, ...more) => {
  const view = inside(`${name}.html`), json = inside(`${name}.json`);
  bitr('assemble', source, reference, '--backend', 'cpu', '--view', view, '--json', json, ...more);
  return { view, result: JSON.parse(readFileSync(json, 'utf8')) };
};

let browser, copy, parts, several;
before(async () => {
  bitr('generate', 'copy', '--out', folder, '--count', '1', '--points', '3000', '--seed', '1');
  bitr('generate', 'aircraft', '--out', folder, '--count', '1', '--points', '2000', '--seed', '20005');
  copy = assemble(inside('copy_000_source.ply'), inside('copy_000_reference.ply'), 'copy', '--complete-match');
  const halves = [inside('aircraft_000_source.ply'), inside('aircraft_000_reference.ply')];
  parts = assemble(...halves, 'parts', '--model', 'aircraft', '--refine');
  several = assemble(...halves, 'several');
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

const slide = (page, s) => page.locator('#progress').fill(String(s));
const show = async (page, ...layers) => {
  for (const layer of ['source', 'reference', 'source-keys', 'reference-keys'])
    await page.locator(`#show-${layer}`).setChecked(layers.includes(layer));
};
const silent = (page) => {
  assert.deepEqual(page.complaints, []);
  assert.deepEqual(page.requests.length, 1, `asks for ${page.requests}`);
};

test('shows both clouds, and each alone', async () => {
  const page = await open(browser, parts.view);
  const scene = page.locator('#scene');
  await picture(page.locator('body'), 'parts_page');
  await show(page, 'source', 'reference');
  const both = await picture(scene, 'parts');
  assert.ok(count(both, 'orange') > 5000 && count(both, 'blue') > 5000);
  await show(page, 'source');
  const source = await picture(scene, 'parts_source');
  assert.ok(count(source, 'orange') > 5000);
  assert.equal(count(source, 'blue'), 0);
  await show(page, 'reference');
  const reference = await picture(scene, 'parts_reference');
  assert.ok(count(reference, 'blue') > 5000);
  assert.equal(count(reference, 'orange'), 0);
  await show(page);
  const none = await picture(scene, 'parts_none');
  assert.equal(count(none, 'orange') + count(none, 'blue'), 0);
  for (const keys of ['source-keys', 'reference-keys']) {
    await show(page, keys);
    assert.ok(!(await picture(scene, keys)).data.equals(none.data), keys);
  }
  silent(page);
});

test('the slider takes a moved copy over its original', async () => {
  const page = await open(browser, copy.view);
  const scene = page.locator('#scene');
  const masks = async (s) => {
    await slide(page, s);
    await show(page, 'source');
    const source = mask(await picture(scene, `copy_source_${s}`), 'orange');
    await show(page, 'reference');
    return [source, mask(await picture(scene, `copy_reference_${s}`), 'blue')];
  };
  const given = await masks(0), between = await masks(0.5), assembled = await masks(1);
  assert.ok(overlap(...assembled) > 0.95, `${overlap(...assembled)} when assembled`);
  assert.ok(overlap(...given) < 0.3, `${overlap(...given)} as given`);
  for (const [a, b] of [[given, between], [between, assembled]]) assert.ok(overlap(a[0], b[0]) < 0.9);
  silent(page);
});

test('a choice flips through the poses that were found', async () => {
  const page = await open(browser, several.view);
  const found = [several.result, ...several.result.alternatives];
  assert.ok(found.length > 1);
  assert.equal(await page.locator('#pose option').count(), found.length);
  const pictures = [];
  for (const [i, { transform, confidence, proposal }] of found.entries()) {
    await page.locator('#pose').selectOption({ index: i });
    const pose = await page.evaluate(() => window.bitr.poseAt(1));
    pose.flat().forEach((x, k) => assert.ok(Math.abs(x - transform.flat()[k]) < 1e-9, `pose ${i}: ${x}`));
    const label = await page.locator(`#pose option >> nth=${i}`).textContent();
    assert.equal(label, `${confidence.toFixed(2)}, ${proposal}`);
    pictures.push((await picture(page.locator('#scene'), `several_${i}`)).data);
  }
  assert.ok(!pictures[0].equals(pictures[1]));
  silent(page);
  const one = await open(browser, copy.view);
  assert.ok(await one.locator('#poses').isHidden());
});

test('the motion ends at the pose, and is rigid on its way', async () => {
  for (const { view, result } of [copy, parts]) {
    const page = await open(browser, view);
    const poses = await page.evaluate(() => [0, 0.25, 0.5, 1].map((s) => window.bitr.poseAt(s)));
    const near = (a, b, bound, what) =>
      a.flat().forEach((x, i) => assert.ok(Math.abs(x - b.flat()[i]) < bound, `${what}: ${x}, ${b.flat()[i]}`));
    near(poses[3], result.transform, 1e-12, 'the pose');
    const turn = (pose) => {
      const r = pose.slice(0, 3).map((row) => row.slice(0, 3));
      const product = r.map((a) => r.map((b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2]));
      near(product, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], 1e-6, 'R Rᵀ');
      return Math.acos(Math.min(1, (r[0][0] + r[1][1] + r[2][2] - 1) / 2));
    };
    assert.equal(turn(poses[0]), 0);
    for (const [at, s] of [[1, 0.25], [2, 0.5]]) assert.ok(Math.abs(turn(poses[at]) - s * turn(poses[3])) < 1e-6);
    silent(page);
  }
});

test('keys turn and zoom, and one takes everything back', async () => {
  const page = await open(browser, parts.view);
  const scene = page.locator('#scene');
  await scene.focus(); // its frame is part of the picture
  await page.keyboard.press('Home');
  const start = await picture(scene, 'keys_start');
  for (const key of ['ArrowLeft', 'ArrowUp', 'Shift+ArrowRight', '+', '-']) {
    await scene.press(key);
    assert.ok(!(await picture(scene, 'keys_moved')).data.equals(start.data), key);
    await scene.press('Home');
    assert.ok((await picture(scene, 'keys_back')).data.equals(start.data), `Home after ${key}`);
  }
  await scene.hover();
  await page.mouse.down();
  await page.mouse.move(300, 300, { steps: 3 });
  await page.mouse.up();
  assert.ok(!(await picture(scene, 'dragged')).data.equals(start.data));
  silent(page);
});

test('every control has a name and is reached by the keyboard', async () => {
  const page = await open(browser, parts.view);
  const controls = page.locator('input:visible, button:visible, canvas');
  const names = await controls.evaluateAll((all) =>
    all.map((one) => (one.labels?.[0] ?? one).innerText?.trim() || one.getAttribute('aria-label')),
  );
  assert.ok(names.length >= 9 && names.every(Boolean), JSON.stringify(names));
  const reached = new Set();
  for (let i = 0; i < 20; ++i) {
    await page.keyboard.press('Tab');
    reached.add(await page.evaluate(() => document.activeElement.id));
  }
  for (const id of ['scene', 'progress', 'play', 'show-source', 'size', 'reset']) assert.ok(reached.has(id), id);
});

test('larger points cover more, a dark page is dark', async () => {
  const page = await open(browser, parts.view, { colorScheme: 'dark' });
  const scene = page.locator('#scene');
  const usual = await picture(scene, 'dark');
  assert.ok(usual.data[0] < 50, 'the corner');
  await page.locator('#size').fill('1');
  assert.ok(count(await picture(scene, 'large'), 'orange') > 1.3 * count(usual, 'orange'));
  await page.emulateMedia({ colorScheme: 'light' });
  assert.ok((await picture(scene, 'light')).data[0] > 200, 'changed while it is open');
  silent(page);
});

test('the report is all there, whatever its keys and the names of the files', async () => {
  const name = `<!--<script>"'&amp;.ply`;
  renameSync(inside('copy_000_source.ply'), inside(name));
  const odd = assemble(inside(name), inside('copy_000_reference.ply'), 'odd', '--complete-match');
  const page = await open(browser, odd.view);
  assert.equal(await page.locator('h1').innerText(), `${name} → copy_000_reference.ply`);
  const text = await page.locator('#report').innerText();
  for (const key of Object.keys(odd.result.diagnostics)) assert.ok(text.includes(key.replaceAll('_', ' ')), key);
  assert.match(text, /overlap\s+1\b/);
  silent(page);

  // A key that no version of the page has heard of.
  const data = readFileSync(odd.view, 'utf8').replace(
    '"diagnostics":{',
    '"opinion":{"level":"high","reasons":["the cats agree","so do the dogs"]},"diagnostics":{',
  );
  writeFileSync(inside('later.html'), data);
  const later = await open(browser, inside('later.html'));
  const found = await later.locator('#report').innerText();
  for (const words of ['confidence', 'opinion', 'high', 'the cats agree', 'so do the dogs'])
    assert.ok(found.includes(words), words);
});

test('without WebGL it says so, and still tells the result', async () => {
  const context = await browser.newContext();
  await context.addInitScript(() => (HTMLCanvasElement.prototype.getContext = () => null));
  const page = await context.newPage();
  await page.goto(`file://${parts.view}`);
  assert.match(await page.locator('#message').innerText(), /cannot draw/);
  assert.match(await page.locator('#report').innerText(), /diagnostics[^]*transform/);
  assert.ok(await page.locator('form').isHidden());
});

test("the clouds' own colours, and thinning that is told", async () => {
  const rows = (colour, shift) =>
    Array.from({ length: 201000 }, (_, i) => {
      const z = 1 - (2 * i + 1) / 201000, turn = 2.399963 * i, across = Math.sqrt(1 - z * z);
      return `${across * Math.cos(turn) + shift} ${across * Math.sin(turn) * 2} ${z * 3} ${colour}`;
    }).join('\n');
  const ply = (colour, shift) =>
    'ply\nformat ascii 1.0\nelement vertex 201000\nproperty float x\nproperty float y\nproperty float z\n' +
    `property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n${rows(colour, shift)}\n`;
  writeFileSync(inside('red.ply'), ply('220 20 20', 0));
  writeFileSync(inside('green.ply'), ply('20 200 20', 1.5));
  const { view } = assemble(inside('red.ply'), inside('green.ply'), 'own', '--complete-match', '--points', '500');
  const page = await open(browser, view);
  const scene = page.locator('#scene');
  assert.match(await page.locator('#notes').innerText(), /201,000 points, thinned evenly to 200,000/);
  await slide(page, 0);
  await show(page, 'source', 'reference');
  const pieces = await picture(scene, 'by_piece');
  assert.ok(count(pieces, 'orange') > 5000 && count(pieces, 'blue') > 5000);
  assert.equal(count(pieces, 'green'), 0);
  await page.getByLabel('own').check();
  const own = await picture(scene, 'own');
  assert.ok(count(own, 'red') > 5000 && count(own, 'green') > 5000);
  assert.equal(count(own, 'blue'), 0);
  silent(page);
});
