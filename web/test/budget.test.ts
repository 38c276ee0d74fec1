// Tests the GPU memory that the viewer takes, as counted by intercepted WebGL calls.
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage } from '../src/headless-page';
import type { SceneOptions } from '../src/scene';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { countGpuMemory, type GpuMemory } from './gpu-memory';
import { goldenScene, launch, missing, serve, type Server } from './machine';
import { psnr } from './pictures';
import { kWidth, viewAt } from './views';

declare const headlessPage: HeadlessPage;
declare const gpuMemory: GpuMemory;

describe.skipIf(missing())('the GPU memory', () => {
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

  // Seen from the wall between two blocks, each takes half of the image. There is no background block, which would
  // shine through.
  it('holds the tiles that fit, and the coarser level is drawn in place of the rest', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'tessera-without-background block-'));
    cpSync(goldenScene, folder, { recursive: true });
    const json = JSON.parse(readFileSync(join(folder, 'tileset.json'), 'utf8'));
    json.root.contents = json.root.contents.filter((one: any) => !one.extensions.TESSERA_scene.background_block);
    json.root.boundingVolume = json.root.contents[0].boundingVolume;
    writeFileSync(join(folder, 'tileset.json'), JSON.stringify(json));
    const alone = await serve(folder);
    const page = await browser.newPage();
    await page.goto(`${alone.url}headless.html`);
    await page.waitForFunction(() => 'headlessPage' in window);
    const above = viewAt(tileset, [0, -0.6, 1.4], [0, 0, -0.6]);
    const draw = async (options: SceneOptions) => {
      await page.evaluate((one) => headlessPage.open('scene/tileset.json', one), options);
      await page.evaluate((view) => headlessPage.settle(view), above);
      const pixels = Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64');
      const statistics = await page.evaluate(() => headlessPage.city!.statistics!);
      await page.evaluate(() => headlessPage.close());
      return { pixels, statistics };
    };
    const fine = await draw({ selection: { maximumScreenSpaceError: 0.01 } });
    const coarse = await draw({ selection: { maximumScreenSpaceError: 0.01, finestLevel: 1 } });
    const gpuBytes = Math.round(fine.statistics.gpuBytes * 0.8) + fine.statistics.targetBytes;
    const mixed = await draw({ selection: { maximumScreenSpaceError: 0.01 }, stream: { gpuBytes } });
    expect(fine.statistics.drawn).toEqual([2, 0]);
    expect(mixed.statistics.drawn).toEqual([1, 1]);
    expect(mixed.statistics.refused).toBe(1);
    const selectHalf = (pixels: Buffer, right: boolean) =>
      pixels.filter((_, i) => (Math.floor(i / 3) % kWidth >= kWidth / 2) === right);
    const kinds = [false, true].map((right) => {
      const isLike = (other: Buffer) => psnr(selectHalf(mixed.pixels, right), selectHalf(other, right)) > 50;
      return [isLike(fine.pixels), isLike(coarse.pixels)];
    });
    expect(kinds.sort()).toEqual([[false, true], [true, false]]);
    await page.close();
    alone.close();
    rmSync(folder, { recursive: true });
  });

  it('stays within the budget during a flight, and is freed afterwards', async () => {
    const page = await browser.newPage();
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    await page.addInitScript(countGpuMemory);
    await page.goto(`${server.url}headless.html`);
    await page.waitForFunction(() => 'headlessPage' in window);

    // Over one block, over the other, and with both in view: the budget fits one, and the coarser level represents the
    // other.
    const over = (x: number) => viewAt(tileset, [x, 0.02, 0.1], [x, 0, -0.7]);
    const both = viewAt(tileset, [0.3, -2.5, 1.5], [0, 0, -0.4]);
    const flight = [over(-1), both, over(1), over(-0.98), over(0.98), both, over(1.02), over(-1.02)];
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 1e9 } }));
    const before = await page.evaluate(() => gpuMemory.bytes);
    await page.evaluate((view) => headlessPage.settle(view), flight[0]);
    await page.evaluate(() => headlessPage.close());
    const empty = await page.evaluate(() => gpuMemory.bytes);
    expect(empty).toBeLessThanOrEqual(before * 1.05 + 65536);

    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0.01 } }));
    await page.evaluate((view) => headlessPage.settle(view), both);
    const all = await page.evaluate(() => headlessPage.city!.statistics!);
    await page.evaluate(() => headlessPage.close());
    expect(all.drawn).toEqual([2, 0]);
    const budget = Math.round(all.gpuBytes * 0.8) + all.targetBytes;
    await page.evaluate(
      (gpuBytes) => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0.01 }, stream: { gpuBytes } }), budget);
    const own = await page.evaluate(() => gpuMemory.bytes);
    await page.evaluate(() => (gpuMemory.maximum = gpuMemory.bytes));
    const drawn: number[][] = [];
    for (const view of flight) {
      await page.evaluate((one) => headlessPage.settle(one), view);
      const [bytes, maximum, statistics] = await page.evaluate(
        () => [gpuMemory.bytes, gpuMemory.maximum, headlessPage.city!.statistics!] as const);
      expect(bytes - own).toBeLessThanOrEqual(budget);
      expect(maximum - own).toBeLessThanOrEqual(budget);
      drawn.push(statistics.drawn);
      const pixels = Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64');
      expect(new Set(pixels).size).toBeGreaterThan(20); // the image is not blank
    }
    expect(drawn).toEqual(flight.map((view) => (view === both ? [1, 1] : [1, 0])));
    expect(await page.evaluate(() => headlessPage.errors)).toEqual([]);
    await page.evaluate(() => headlessPage.close());
    expect(await page.evaluate(() => gpuMemory.bytes)).toBeLessThanOrEqual(own * 1.05);
    expect(said).toEqual([]);
    await page.close();
  });
});
