// What the viewer takes of the graphics card, as counted from outside.
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain } from '../src/plain';
import type { SceneOptions } from '../src/scene';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { countCardMemory, type CardMemory } from './card-memory';
import { goldenScene, launch, missing, serve, type Server } from './machine';
import { psnr } from './pictures';
import { kWidth, viewAt } from './views';

declare const plain: Plain;
declare const cardMemory: CardMemory;

describe.skipIf(missing())('the graphics card', () => {
  let server: Server;
  let browser: Browser;
  const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
  });

  // Seen from the wall between them, a block has a half of the picture. Without a surround, which shines through.
  it('holds what it has room for, and the coarser level is drawn in place of the rest', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'tessera-without-surround-'));
    cpSync(goldenScene, folder, { recursive: true });
    const json = JSON.parse(readFileSync(join(folder, 'tileset.json'), 'utf8'));
    json.root.contents = json.root.contents.filter((one: any) => !one.extensions.TESSERA_scene.surround);
    json.root.boundingVolume = json.root.contents[0].boundingVolume;
    writeFileSync(join(folder, 'tileset.json'), JSON.stringify(json));
    const alone = await serve(folder);
    const page = await browser.newPage();
    await page.goto(`${alone.url}plain.html`);
    await page.waitForFunction(() => 'plain' in window);
    const above = viewAt(tileset, [0, -0.6, 1.4], [0, 0, -0.6]);
    const draw = async (options: SceneOptions) => {
      await page.evaluate((one) => plain.open('scene/tileset.json', one), options);
      await page.evaluate((view) => plain.settle(view), above);
      const pixels = Buffer.from(await page.evaluate(() => plain.pixels()), 'base64');
      const statistics = await page.evaluate(() => plain.city!.statistics!);
      await page.evaluate(() => plain.close());
      return { pixels, statistics };
    };
    const fine = await draw({ selection: { mostPixels: 0.01 } });
    const coarse = await draw({ selection: { mostPixels: 0.01, finestLevel: 1 } });
    const cardBytes = Math.round(fine.statistics.cardBytes * 0.8) + fine.statistics.targetBytes;
    const mixed = await draw({ selection: { mostPixels: 0.01 }, stream: { cardBytes } });
    expect(fine.statistics.drawn).toEqual([2, 0]);
    expect(mixed.statistics.drawn).toEqual([1, 1]);
    expect(mixed.statistics.refused).toBe(1);
    const halfOf = (pixels: Buffer, right: boolean) =>
      pixels.filter((_, i) => (Math.floor(i / 3) % kWidth >= kWidth / 2) === right);
    const kinds = [false, true].map((right) => {
      const isLike = (other: Buffer) => psnr(halfOf(mixed.pixels, right), halfOf(other, right)) > 50;
      return [isLike(fine.pixels), isLike(coarse.pixels)];
    });
    expect(kinds.sort()).toEqual([[false, true], [true, false]]);
    await page.close();
    alone.close();
    rmSync(folder, { recursive: true });
  });

  it('holds no more than the budget during a flight, and nothing of the scene afterwards', async () => {
    const page = await browser.newPage();
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    await page.addInitScript(countCardMemory);
    await page.goto(`${server.url}plain.html`);
    await page.waitForFunction(() => 'plain' in window);

    // Over one block, over the other, and both in view: there is room for one, and the coarser level stands for the other.
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
    expect(drawn).toEqual(flight.map((view) => (view === both ? [1, 1] : [1, 0])));
    expect(await page.evaluate(() => plain.errors)).toEqual([]);
    await page.evaluate(() => plain.close());
    expect(await page.evaluate(() => cardMemory.bytes)).toBeLessThanOrEqual(own * 1.05);
    expect(said).toEqual([]);
    await page.close();
  });
});
