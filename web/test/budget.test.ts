// What the viewer takes of the graphics card, as counted from outside.
import { readFileSync } from 'node:fs';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain } from '../src/plain';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { countCardMemory, type CardMemory } from './card-memory';
import { goldenScene, launch, missing, serve, type Server } from './machine';
import { viewAt } from './views';

declare const plain: Plain;
declare const cardMemory: CardMemory;

describe.skipIf(missing())('the graphics card', () => {
  let server: Server;
  let browser: Browser;
  const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json');

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
  });

  it('holds no more than the budget during a flight, and nothing of the scene afterwards', async () => {
    const page = await browser.newPage();
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    await page.addInitScript(countCardMemory);
    await page.goto(`${server.url}plain.html`);
    await page.waitForFunction(() => 'plain' in window);

    // Over one block, over the other, and both in view: there is no room for both.
    const over = (x: number) => viewAt(tileset, [x, 0.02, 0.1], [x, 0, -0.7]);
    const both = viewAt(tileset, [0.3, -2.5, 1.5], [0, 0, -0.4]);
    const flight = [over(-1), both, over(1), over(-0.98), over(0.98), both, over(1.02), over(-1.02)];
    await page.evaluate(() => plain.open('scene/tileset.json', { selection: { mostPixels: 1e9 } }));
    const before = await page.evaluate(() => cardMemory.bytes);
    await page.evaluate((view) => plain.settle(view), flight[0]);
    await page.evaluate(() => plain.close());
    const empty = await page.evaluate(() => cardMemory.bytes);
    expect(empty).toBeLessThanOrEqual(before * 1.05 + 65536);

    await page.evaluate(() => plain.open('scene/tileset.json', { selection: { mostPixels: 0.01 } }));
    await page.evaluate((view) => plain.settle(view), both);
    const all = await page.evaluate(() => plain.city!.statistics!);
    await page.evaluate(() => plain.close());
    expect(all.drawn).toEqual([2, 0]);
    const budget = Math.round(all.cardBytes * 0.8) + all.targetBytes;
    await page.evaluate(
      (cardBytes) => plain.open('scene/tileset.json', { selection: { mostPixels: 0.01 }, stream: { cardBytes } }), budget);
    const own = await page.evaluate(() => cardMemory.bytes);
    await page.evaluate(() => (cardMemory.most = cardMemory.bytes));
    const drawn: number[][] = [];
    for (const view of flight) {
      await page.evaluate((one) => plain.settle(one), view);
      const [bytes, most, statistics] = await page.evaluate(
        () => [cardMemory.bytes, cardMemory.most, plain.city!.statistics!] as const);
      expect(bytes - own).toBeLessThanOrEqual(budget);
      expect(most - own).toBeLessThanOrEqual(budget);
      drawn.push(statistics.drawn);
      const pixels = Buffer.from(await page.evaluate(() => plain.pixels()), 'base64');
      expect(new Set(pixels).size).toBeGreaterThan(20); // not blank
    }
    expect(drawn).toEqual(flight.map((view) => (view === both ? [0, 1] : [1, 0])));
    expect(await page.evaluate(() => plain.errors)).toEqual([]);
    await page.evaluate(() => plain.close());
    expect(await page.evaluate(() => cardMemory.bytes)).toBeLessThanOrEqual(own * 1.05);
    expect(said).toEqual([]);
    await page.close();
  });
});
