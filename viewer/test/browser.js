// Chromium without a screen, and what its pictures show.
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { chromium } from 'playwright-core';
import { PNG } from 'pngjs';

const { BITR_CHROMIUM: executablePath = '/usr/bin/chromium', BITR_PICTURES: pictures = 'build/pictures' } = process.env;

export const launch = () =>
  chromium.launch({
    executablePath,
    args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
      '--disable-component-update', '--disable-sync', '--use-gl=angle', '--use-angle=swiftshader',
      '--enable-unsafe-swiftshader'],
  });

/** The page of a file, with everything it complains of and asks for. */
export async function open(browser, file, options = {}) {
  const page = await browser.newPage({ viewport: { width: 1000, height: 640 }, ...options });
  page.setDefaultTimeout(120_000); // two cores draw and do everything else
  page.complaints = [];
  page.requests = [];
  page.on('console', (message) => page.complaints.push(`${message.type()}: ${message.text()}`));
  page.on('pageerror', (error) => page.complaints.push(String(error)));
  page.on('request', (request) => page.requests.push(request.url()));
  await page.goto(`file://${encodeURI(file).replaceAll('#', '%23').replaceAll('?', '%3F')}`);
  return page;
}

/** Once everything that was asked for has been drawn; kept under its name to be looked at. */
export async function picture(locator, name) {
  const page = locator.page();
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  const bytes = await locator.screenshot();
  mkdirSync(pictures, { recursive: true });
  writeFileSync(join(pictures, `${name}.png`), bytes);
  return PNG.sync.read(bytes);
}

const paints = {
  orange: (r, g, b) => r > b + 40,
  blue: (r, g, b) => b > r + 40,
  red: (r, g, b) => r > g + 60 && r > b + 60,
  green: (r, g, b) => g > r + 60 && g > b + 60,
};

/** One entry a pixel: whether it has that paint. */
export function mask({ data }, paint) {
  const has = paints[paint];
  return Array.from({ length: data.length / 4 }, (_, i) => has(data[4 * i], data[4 * i + 1], data[4 * i + 2]));
}

export const count = (image, paint) => mask(image, paint).filter(Boolean).length;

/** Pixels in both over pixels in either. */
export function overlap(a, b) {
  let both = 0, either = 0;
  a.forEach((in_a, i) => {
    both += in_a && b[i];
    either += in_a || b[i];
  });
  return both / either;
}
