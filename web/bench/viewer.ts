// The viewer in a browser, measured: bench/viewer.sh. Each row prints its figures, and fails where a bound is missed.
import { mkdtempSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain, View } from '../src/plain';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { countCardMemory, type CardMemory } from '../test/card-memory';
import { launch, run, serve, type Server } from '../test/machine';
import { cameraPath, decodePng, psnr } from '../test/pictures';
import { kFieldOfView, kHeight, kWidth, viewAt } from '../test/views';

declare const plain: Plain;
declare const cardMemory: CardMemory;

const needed = (name: string) => process.env[name] ?? expect.fail(`${name} names no folder`);
const small = needed('SMALL_SCENE'); // 2x2 blocks
const smallCapture = needed('SMALL_CAPTURE');
const large = needed('LARGE_SCENE'); // 4x4 blocks, two coarser levels

function verdict(what: string, value: number, how: '>=' | '<=', bound: number): void {
  const holds = how === '>=' ? value >= bound : value <= bound;
  console.log(`${what}: ${Number(value.toPrecision(5))} (wanted ${how} ${bound}) ${holds ? 'ok' : 'FAILED'}`);
  expect.soft(holds, what).toBe(true);
}

function tilesetOf(scene: string) {
  return decodeTileset(readFileSync(join(scene, 'tileset.json'), 'utf8'), 'tileset.json');
}

// Bytes of all files of a scene, and of the contents of one level.
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
    await page.addInitScript(countCardMemory);
    await page.goto(`${server.url}plain.html`);
    await page.waitForFunction(() => 'plain' in window);
    return page;
  }
  async function close(page: Page): Promise<void> {
    await page.close();
    server.close();
    expect.soft(said.splice(0)).toEqual([]);
  }

  it('draws held-out views as the processor does', async () => {
    const tileset = tilesetOf(small);
    const capture = JSON.parse(readFileSync(join(smallCapture, 'transforms.json'), 'utf8')) as {
      test_filenames: string[];
      train_filenames: string[];
      frames: { file_path: string; transform_matrix: number[][] }[];
    };
    // Ten of them; where fewer are held out, the first of the others.
    const names = [...capture.test_filenames, ...capture.train_filenames].slice(0, 10);
    const focal = kHeight / 2 / Math.tan((kFieldOfView * Math.PI) / 360);
    const views = names.map((name): View => {
      const rows = capture.frames.find((frame) => frame.file_path === name)!.transform_matrix;
      const matrix = [0, 1, 2, 3].flatMap((column) => [0, 1, 2, 3].map((row) => rows[row]?.[column] ?? (column === 3 ? 1 : 0)));
      return { matrix, fx: focal, fy: focal, cx: kWidth / 2, cy: kHeight / 2, width: kWidth, height: kHeight };
    });
    const path = join(folder, 'path.json');
    writeFileSync(path, cameraPath(tileset, views.map(({ matrix }) => matrix)));
    run('render', small, join(folder, 'oracle'), '--path', path);
    const page = await open(small);
    console.log(`drawn by ${await page.evaluate(() => plain.card())}`);
    await page.evaluate(() => plain.open('scene/tileset.json', { selection: { mostPixels: 0 } }));
    const decibels: number[] = [];
    const seconds: number[] = [];
    for (const [i, view] of views.entries()) {
      await page.evaluate((one) => plain.settle(one), view);
      const pixels = new Uint8Array(Buffer.from(await page.evaluate(() => plain.pixels()), 'base64'));
      decibels.push(psnr(pixels, await decodePng(page, join(folder, 'oracle', `0000${i}.png`))));
      seconds.push(await page.evaluate((one) => plain.time(one, 3), view));
    }
    await close(page);
    console.log(`PSNR against the oracle: ${decibels.map((value) => value.toFixed(1)).join(', ')} dB`);
    console.log(`a frame: ${seconds.map((value) => value.toFixed(2)).join(', ')} s`);
    verdict('ten held-out views, the worst, in dB', Math.min(...decibels), '>=', 38);
  });

  it('shows the first picture of a large scene soon', async () => {
    const tileset = tilesetOf(large);
    const page = await open(large);
    const view = viewAt(tileset, [0, -tileset.rows * 2, tileset.rows * 2], [0, 0, 0]);
    const { seconds, bytes } = await page.evaluate(async (one) => {
      const begin = performance.now();
      await plain.open('scene/tileset.json', { selection: { mostPixels: 1e9 } });
      await plain.settle(one);
      return { seconds: (performance.now() - begin) / 1000, bytes: plain.city!.statistics!.fetchedBytes };
    }, view);
    const total = bytesOnDisk(large);
    const surround = tileset.tiles[0].contents.find((content) => content.surround)?.bytes ?? 0;
    await close(page);
    console.log(`${bytes} of ${total} bytes, ${surround} of them of the surround, in ${seconds.toFixed(2)} s`);
    verdict('coarsest level as a share of the bytes', (bytes - surround) / total, '<=', 0.06);
    verdict('with the surround', bytes / total, '<=', 0.06);
    verdict('seconds to the first complete picture', seconds, '<=', 2);
  });

  it('keeps to a quarter of the finest level in a flight of 600 steps', async () => {
    const tileset = tilesetOf(large);
    const page = await open(large);
    const [columns, rows] = [tileset.columns, tileset.rows];
    const flight = Array.from({ length: 600 }, (_, i) => {
      const turn = (i / 600) * 2 * Math.PI;
      const eye = [columns * 0.8 * Math.cos(turn), rows * 0.8 * Math.sin(2 * turn), 0.5 + 0.4 * Math.cos(3 * turn)] as const;
      const ahead = turn + 0.15;
      return viewAt(tileset, eye, [columns * 0.8 * Math.cos(ahead), rows * 0.8 * Math.sin(2 * ahead), -0.3]);
    });
    const budget = Number(process.env.FINEST_BYTES ?? expect.fail('FINEST_BYTES is missing')) / 4;
    const own = await page.evaluate(() => cardMemory.bytes);
    await page.evaluate((cardBytes) => plain.open('scene/tileset.json', { stream: { cardBytes } }), budget);
    await page.evaluate((view) => plain.settle(view), flight[0]);
    await page.evaluate(() => (cardMemory.most = cardMemory.bytes));
    const entered = await page.evaluate(() => cardMemory.bytes);
    let blank = 0;
    for (const view of flight) {
      await page.evaluate((one) => plain.time(one, 1), view);
      const colours = await page.evaluate(() => new Set(atob(plain.pixels())).size);
      blank += colours < 8 ? 1 : 0;
    }
    const { most, evictions } = await page.evaluate(
      () => ({ most: cardMemory.most, evictions: plain.city!.statistics!.evictions }));
    await page.evaluate(() => plain.close());
    const left = await page.evaluate(() => cardMemory.bytes);
    await close(page);
    console.log(`${entered} bytes at the beginning, ${most} at most, ${evictions} evictions, ${left} bytes left (${own} before)`);
    verdict('bytes on the card at most, as a share of the budget', (most - own) / budget, '<=', 1);
    verdict('blank frames', blank, '<=', 0);
    verdict('bytes left as a share of those before', left / own, '<=', 1.05);
  });
});
