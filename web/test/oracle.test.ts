// The browser's pictures of the golden scene against those of the renderer on the processor.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain } from '../src/plain';
import { decodeTileset } from '../src/tiles/decode-tileset';
import type { Tileset } from '../src/tiles/tileset';
import { goldenScene, launch, missing, run, serve, type Server } from './machine';
import { kFieldOfView, kHeight, kWidth, viewAt, type Place } from './views';

declare const plain: Plain;

// Places of the eye and what it looks at, scene units: inside, above, outside, straight down.
const kLooks: [Place, Place][] = [
  [[-1.8, -0.9, 0.2], [0.5, 0.2, -0.6]],
  [[1.5, 0.9, 0.6], [-0.5, -0.3, -0.5]],
  [[0.1, -4, 2], [0, 0, -0.3]],
  [[-0.7, 0.1, 3], [-0.69, 0.12, 0]],
  [[6, 3, 0.5], [0, 0, 0]],
];

// As a camera path of nerfstudio has it, in the world of the source of the photos; row after row.
function cameraPath(tileset: Tileset, matrices: number[][]): string {
  const s = tileset.sourceFromWorld;
  const scale = Math.hypot(s[0], s[1], s[2]);
  const camera_path = matrices.map((m) => {
    const rows = [0, 1, 2].map((row) =>
      [0, 1, 2, 3].map((column) => {
        const sum = s[row] * m[4 * column] + s[4 + row] * m[4 * column + 1] + s[8 + row] * m[4 * column + 2];
        return column < 3 ? sum / scale : sum + s[12 + row];
      }),
    );
    return { camera_to_world: [...rows.flat(), 0, 0, 0, 1], fov: kFieldOfView, aspect: kWidth / kHeight };
  });
  return JSON.stringify({
    camera_type: 'perspective', render_width: kWidth, render_height: kHeight, fps: matrices.length, seconds: 1, camera_path,
  });
}

function psnr(a: Uint8Array, b: Uint8Array): number {
  expect(a.length).toBe(b.length);
  const squares = a.reduce((sum, value, i) => sum + (value - b[i]) ** 2, 0);
  return 10 * Math.log10((255 ** 2 * a.length) / squares);
}

// Red, green and blue of a PNG, decoded by the browser.
async function decodePng(page: Page, file: string): Promise<Uint8Array> {
  const text = await page.evaluate(async (base64) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    let bytes = '';
    for (let i = 0; i < data.length; ++i) if (i % 4 < 3) bytes += String.fromCharCode(data[i]);
    return btoa(bytes);
  }, readFileSync(file).toString('base64'));
  return new Uint8Array(Buffer.from(text, 'base64'));
}

describe.skipIf(missing())('the browser', () => {
  let server: Server;
  let browser: Browser;
  let folder: string;
  const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json');
  const views = kLooks.map(([eye, target]) => viewAt(tileset, eye, target));

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-browser-'));
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    rmSync(folder, { recursive: true });
  });

  it.each([0, 1])('draws what the processor draws: level %i', async (level) => {
    const path = join(folder, `path-${level}.json`);
    writeFileSync(path, cameraPath(tileset, views.map(({ matrix }) => matrix)));
    run('render', goldenScene, join(folder, String(level)), '--path', path, '--lod', String(level));
    const page = await browser.newPage();
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.goto(`${server.url}plain.html`);
    await page.waitForFunction(() => 'plain' in window);
    await page.evaluate(
      (finestLevel) => plain.open('scene/tileset.json', { selection: { mostPixels: 0, finestLevel } }), level);
    for (const [i, view] of views.entries()) {
      await page.evaluate((one) => plain.settle(one), view);
      const pixels = new Uint8Array(Buffer.from(await page.evaluate(() => plain.pixels()), 'base64'));
      const expected = await decodePng(page, join(folder, String(level), `0000${i}.png`));
      expect(new Set(expected).size).toBeGreaterThan(20); // something is to be seen
      expect(psnr(pixels, expected)).toBeGreaterThan(38);
    }
    expect(await page.evaluate(() => plain.errors)).toEqual([]);
    expect(said).toEqual([]);
    // Browsers take the card away now and then: all comes back.
    const before = await page.evaluate(() => plain.pixels());
    await page.evaluate(() => plain.loseCard());
    await page.evaluate((view) => plain.settle(view), views[views.length - 1]);
    expect(await page.evaluate(() => plain.pixels())).toBe(before);
    await page.close();
  });
});
