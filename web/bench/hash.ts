// Measures `hash` scenes in a browser: bench/hash.sh (ROWS=browser).
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage } from '../src/headless-page';
import { launch, serve } from '../test/machine';
import { againstOracle, tell } from './against-oracle';
import { needed, verdict } from './verdict';

declare const headlessPage: HeadlessPage;

// SCENES: for each scene its folder and that of its capture, alternating. OUT: folder for images.
const words = needed('SCENES').split(' ');
const scenes = words.flatMap((scene, i) => (i % 2 === 0 ? [[scene, words[i + 1]]] : []));
const out = needed('OUT');

describe('the viewer', () => {
  let browser: Browser;

  beforeAll(async () => {
    browser = await launch();
  });
  afterAll(() => browser.close());

  it.each(scenes)('draws held-out views as the CPU does: %s', async (scene, capture) => {
    const server = await serve(scene);
    const page = await browser.newPage();
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.goto(`${server.url}headless.html`);
    await page.waitForFunction(() => 'headlessPage' in window);
    console.log(`${scene}, drawn by ${await page.evaluate(() => headlessPage.gpu())}`);
    const { decibels, seconds } = await againstOracle(page, scene, capture, join(out, scene.split('/').at(-1)!));
    await page.close();
    server.close();
    tell(decibels, seconds);
    verdict('ten held-out views, the worst, in dB', Math.min(...decibels), '>=', 38);
    expect.soft(said).toEqual([]);
  });
});
