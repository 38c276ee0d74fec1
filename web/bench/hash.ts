// Scenes of `hash` in a browser: bench/hash.sh (ROWS=browser).
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain } from '../src/plain';
import { launch, serve } from '../test/machine';
import { againstOracle, tell } from './against-oracle';
import { needed, verdict } from './verdict';

declare const plain: Plain;

// SCENES: of each scene its folder and that of its capture, in turn. OUT: where pictures go.
const words = needed('SCENES').split(' ');
const scenes = words.flatMap((scene, i) => (i % 2 === 0 ? [[scene, words[i + 1]]] : []));
const out = needed('OUT');

describe('the viewer', () => {
  let browser: Browser;

  beforeAll(async () => {
    browser = await launch();
  });
  afterAll(() => browser.close());

  it.each(scenes)('draws held-out views as the processor does: %s', async (scene, capture) => {
    const server = await serve(scene);
    const page = await browser.newPage();
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.goto(`${server.url}plain.html`);
    await page.waitForFunction(() => 'plain' in window);
    console.log(`${scene}, drawn by ${await page.evaluate(() => plain.card())}`);
    const { decibels, seconds } = await againstOracle(page, scene, capture, join(out, scene.split('/').at(-1)!));
    await page.close();
    server.close();
    tell(decibels, seconds);
    verdict('ten held-out views, the worst, in dB', Math.min(...decibels), '>=', 38);
    expect.soft(said).toEqual([]);
  });
});
