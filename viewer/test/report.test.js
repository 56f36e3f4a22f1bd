// The page of bitr eval --html, as a browser shows it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { count, launch, open, picture } from './browser.js';

const folder = mkdtempSync(join(tmpdir(), 'bitr_report_'));
const report = join(folder, 'report.html'), judged = join(folder, 'judged.html');
let browser;
before(async () => {
  const evaluate = (...options) =>
    execFileSync(process.env.BITR_COMMAND, [
      'eval', '--kind', 'aircraft', '--share', '1,0.6', '--points', '300', '--samples', '20', '--methods',
      'identity,pca-icp', ...options,
    ]);
  evaluate('--html', report);
  evaluate('--html', judged, '--confidence');
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

test('has its table, charts and pictures on the screen', async () => {
  const page = await open(browser, report);
  await picture(page.locator('body'), 'report');
  assert.equal(await page.locator('tbody tr').count(), 2 + 4);
  const charts = page.locator('svg');
  assert.equal(await charts.count(), 3);
  for (let i = 0; i < 3; ++i) {
    const chart = await picture(charts.nth(i), `report_chart_${i}`);
    assert.ok(count(chart, 'blue') > 200, `the first method in chart ${i}`);
    assert.ok(count(chart, 'red') > 200, `the second method in chart ${i}`);
  }
  const images = page.locator('img');
  assert.equal(await images.count(), 16);
  for (const image of await images.all()) assert.ok((await image.evaluate((one) => one.naturalWidth)) > 0);
  const pair = await picture(images.first(), 'report_pair');
  assert.ok(count(pair, 'orange') > 1000 && count(pair, 'blue') > 1000);
  assert.deepEqual(page.complaints, []);
  assert.deepEqual(page.requests.filter((url) => !url.startsWith('data:')).length, 1);
});

test('has how far its poses could be trusted', async () => {
  const page = await open(browser, judged);
  assert.equal(await page.locator('#confidence tbody tr').count(), 3 + 6);
  const charts = page.locator('svg');
  assert.equal(await charts.count(), 4);
  const chart = await picture(charts.first(), 'report_reliability');
  assert.ok(count(chart, 'blue') > 200 && count(chart, 'red') > 200);
  const dot = charts.first().locator('circle').first();
  assert.match(await dot.locator('title').textContent(), /^identity: said 0\.\d\d, was \d\.\d\d \(\d+ poses?\)$/);
  const [place, image] = [await dot.boundingBox(), await charts.first().boundingBox()];
  assert.ok(place.x > image.x && place.y + place.height < image.y + image.height);
  const captions = await page.locator('figure:has(img) figcaption').allTextContents();
  assert.equal(captions.length, 16);
  for (const caption of captions) assert.match(caption, /, confidence \d\.\d\d$/);
  assert.deepEqual(page.complaints, []);
});

test('is dark where the system is', async () => {
  const page = await open(browser, report, { colorScheme: 'dark' });
  assert.ok((await picture(page.locator('body'), 'report_dark')).data[0] < 60);
});
