// Measures the viewer in a browser: bench/viewer.sh. Each row prints its figures, and fails if a bound is missed.
import { mkdtempSync, readdirSync, rmSync, statSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage } from '../src/headless-page';
import { countGpuMemory, type GpuMemory } from '../test/gpu-memory';
import { launch, serve, type Server } from '../test/machine';
import { capturedViews } from '../test/pictures';
import { kWidth, viewAt } from '../test/views';
import { againstOracle, tell, loadTileset } from './against-oracle';
import { placesOfDepth } from './true-depth';
import { needed, verdict } from './verdict';

declare const headlessPage: HeadlessPage;
declare const gpuMemory: GpuMemory;

const small = needed('SMALL_SCENE'); // 2x2 blocks
const smallCapture = needed('SMALL_CAPTURE');
const large = needed('LARGE_SCENE'); // 4x4 blocks, two coarser levels

const kNetworks = [
  { name: 'loopback', megabits: 0, latency: 0 },
  { name: '500 Mbit/s, 10 ms', megabits: 500, latency: 10 },
  { name: '20 Mbit/s, 60 ms, as of a telephone', megabits: 20, latency: 60 },
];

// Returns the bytes of all files of a scene.
function bytesOnDisk(scene: string): number {
  return readdirSync(scene, { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile() && /\.(glb|json)$/.test(entry.name))
    .reduce((sum, entry) => sum + statSync(join(entry.parentPath, entry.name)).size, 0);
}

describe('the viewer', () => {
  let browser: Browser;
  let server: Server;
  let folder: string;
  const said: string[] = [];

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-viewer-bench-'));
    browser = await launch();
  });
  afterAll(async () => {
    await browser.close();
    rmSync(folder, { recursive: true });
  });

  async function open(scene: string): Promise<Page> {
    server = await serve(scene);
    const page = await browser.newPage();
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.addInitScript(countGpuMemory);
    await page.goto(`${server.url}headless.html`);
    await page.waitForFunction(() => 'headlessPage' in window);
    return page;
  }
  async function close(page: Page): Promise<void> {
    await page.close();
    server.close();
    expect.soft(said.splice(0)).toEqual([]);
  }

  it('draws held-out views as the CPU does', async () => {
    const page = await open(small);
    console.log(`drawn by ${await page.evaluate(() => headlessPage.gpu())}`);
    const { decibels, seconds } = await againstOracle(page, small, smallCapture, folder);
    await close(page);
    tell(decibels, seconds);
    verdict('ten held-out views, the worst, in dB', Math.min(...decibels), '>=', 38);
  });

  // Places small cubes slightly in front of the true depth, and slightly behind it.
  it('occludes models behind it and is occluded by those in front', async () => {
    const page = await open(small);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    const counts = { places: 0, inFront: 0, behind: 0 };
    for (const { view, lens, depthFile } of capturedViews(smallCapture, 10)) {
      const places = placesOfDepth(join(smallCapture, depthFile), lens, view);
      counts.places += places.length;
      for (const [kind, factor] of [['inFront', 0.95], ['behind', 1.05]] as const) {
        const cubes = places.map(({ place, eye }) => {
          const away = place.map((x, a) => x - eye[a]);
          const distance = Math.hypot(...away);
          return { middle: away.map((x, a) => eye[a] + factor * x), half: 0.006 * distance };
        });
        await page.evaluate((all) => headlessPage.addCubes(all), cubes);
        await page.evaluate((one) => headlessPage.settle(one), view);
        const pixels = Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64');
        await page.evaluate(() => headlessPage.removeBox());
        for (const { pixel: [x, y] } of places) {
          const at = 3 * (x + kWidth * y);
          const isRed = pixels[at] > 200 && pixels[at + 1] < 60 && pixels[at + 2] < 60;
          if (isRed === (kind === 'inFront')) ++counts[kind];
        }
      }
    }
    await close(page);
    console.log(`${counts.places} places: ${counts.inFront} cubes in front are seen, ${counts.behind} behind are not`);
    verdict('cubes in front of the city that are seen, as a share', counts.inFront / counts.places, '>=', 0.97);
    verdict('cubes behind it that are not, as a share', counts.behind / counts.places, '>=', 0.95);
  });

  it.each(kNetworks)('shows the first picture of a large scene soon: $name', async ({ name, megabits, latency }) => {
    const tileset = loadTileset(large);
    const page = await open(large);
    if (megabits) {
      const bytesASecond = (megabits * 1e6) / 8;
      const session = await page.context().newCDPSession(page);
      await session.send('Network.emulateNetworkConditions', {
        offline: false, latency, downloadThroughput: bytesASecond, uploadThroughput: bytesASecond,
      });
    }
    const view = viewAt(tileset, [0, -tileset.rows * 2, tileset.rows * 2], [0, 0, 0]);
    const { seconds, bytes } = await page.evaluate(async (one) => {
      const begin = performance.now();
      await headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 1e9 } });
      headlessPage.city!.framesAtRest = 1; // further frames only smooth the image
      await headlessPage.drawUntilSettled(one);
      return { seconds: (performance.now() - begin) / 1000, bytes: headlessPage.city!.statistics!.fetchedBytes };
    }, view);
    const total = bytesOnDisk(large);
    const text = statSync(join(large, 'tileset.json')).size;
    await close(page);
    console.log(`${name}: ${bytes} bytes of contents and ${text} of tileset.json, of ${total}, in ${seconds.toFixed(2)} s`);
    if (megabits) return; // reported, without a bound
    verdict('coarsest level with its background block and tileset.json, as a share of the bytes', (bytes + text) / total, '<=', 0.06);
    verdict('seconds to the first complete image', seconds, '<=', 2);
  });

  it('keeps to a quarter of the finest level in a flight of 600 steps', async () => {
    const tileset = loadTileset(large);
    const page = await open(large);
    const [columns, rows] = [tileset.columns, tileset.rows];
    const flight = Array.from({ length: 600 }, (_, i) => {
      const turn = (i / 600) * 2 * Math.PI;
      const eye = [columns * 0.8 * Math.cos(turn), rows * 0.8 * Math.sin(2 * turn), 0.5 + 0.4 * Math.cos(3 * turn)] as const;
      const ahead = turn + 0.15;
      return viewAt(tileset, eye, [columns * 0.8 * Math.cos(ahead), rows * 0.8 * Math.sin(2 * ahead), -0.3]);
    });
    // Of a small scene, images alone may take a quarter of the finest level: with CONTENTS_ALONE they do not count.
    const besides = process.env.CONTENTS_ALONE ? await page.evaluate(async (view) => {
      await headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 1e9 } });
      await headlessPage.settle(view);
      const bytes = headlessPage.city!.statistics!.targetBytes;
      await headlessPage.close();
      return bytes;
    }, flight[0]) : 0;
    const budget = Number(process.env.FINEST_BYTES ?? expect.fail('FINEST_BYTES is missing')) / 4 + besides;
    const own = await page.evaluate(() => gpuMemory.bytes);
    await page.evaluate((gpuBytes) => headlessPage.open('scene/tileset.json', { stream: { gpuBytes } }), budget);
    await page.evaluate((view) => headlessPage.settle(view), flight[0]);
    await page.evaluate(() => (gpuMemory.maximum = gpuMemory.bytes));
    const entered = await page.evaluate(() => gpuMemory.bytes);
    let [blank, without] = [0, 0];
    const drawn = new Array<number>(tileset.levels).fill(0);
    for (const view of flight) {
      await page.evaluate((one) => headlessPage.time(one, 1), view);
      const tiles = await page.evaluate(() => headlessPage.city!.statistics!.drawn);
      tiles.forEach((count, level) => (drawn[level] += count));
      without += tiles.some((count) => count > 0) ? 0 : 1;
      const colours = await page.evaluate(() => new Set(atob(headlessPage.pixels())).size);
      blank += colours < 8 ? 1 : 0;
    }
    const { maximum, evictions } = await page.evaluate(
      () => ({ maximum: gpuMemory.maximum, evictions: headlessPage.city!.statistics!.evictions }));
    await page.evaluate(() => headlessPage.close());
    const left = await page.evaluate(() => gpuMemory.bytes);
    await close(page);
    console.log(`${entered} bytes at the beginning, ${maximum} at maximum, ${evictions} evictions, ${left} bytes left (${own} before)`);
    console.log(`tiles a frame: ${drawn.map((count, level) => `${(count / flight.length).toFixed(2)} of level ${level}`).join(', ')}`);
    verdict('bytes on the GPU at most, as a share of the budget', (maximum - own) / budget, '<=', 1);
    verdict('blank frames', blank, '<=', 0);
    verdict('frames without tiles', without, '<=', 0);
    verdict('bytes left as a share of those before', left / own, '<=', 1.05);
  });
});
