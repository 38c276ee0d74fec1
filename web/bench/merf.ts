// Compares the viewer with MERF's own (google-research, merf/webviewer) in one browser: bench/merf_viewer.sh. Both
// render the same block with the same pinhole cameras and one ray per pixel of 480×270 in every frame; both (MERF's
// with `quality=high`) step by one texel of the planes until the transmittance of a ray is 1/255. Frames alternate, and
// each ends when the GPU has finished it.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { launch, serve, type Server } from '../test/machine';
import { capturedViews, psnr } from '../test/pictures';
import { kFieldOfView, kHeight, kWidth, viewAt } from '../test/views';
import { needed, verdict } from './verdict';

declare const headlessPage: HeadlessPage;
// Global variables of MERF's viewer (three.js r113).
declare let gCamera: { matrixWorld: { fromArray(numbers: number[]): void } };
declare let gRenderer: { getContext(): WebGL2RenderingContext };
declare let gLowResTexture: { width: number; height: number };
declare let gLoadedTextures: number, gNumTextures: number;
declare function renderProgressively(): void;

const viewer = needed('MERF_VIEWER');
const work = needed('MERF_WORK'); // folder of the capture, the scene, and its export for MERF
const scene = join(work, 'scene');
const pictures = join(work, 'pictures');
const near = needed('MERF_NEAR');

const kRounds = 5;
const kFrames = 2; // per round, plus one for warming up
const kHost = 'http://merf.viewer';

const median = (numbers: number[]) => [...numbers].sort((a, b) => a - b)[numbers.length >> 1];

describe('the viewer beside that of MERF', () => {
  const tileset = decodeTileset(readFileSync(join(scene, 'tileset.json'), 'utf8'), 'tileset.json', kCodecs);
  let browser: Browser;
  let server: Server;
  let ours: Page;
  let theirs: Page;
  const said: string[] = [];

  beforeAll(async () => {
    mkdirSync(pictures, { recursive: true });
    [browser, server] = await Promise.all([launch(), serve(scene)]);
    ours = await newPage();
    theirs = await newPage();
  });
  afterAll(async () => {
    await browser.close();
    server.close();
  });

  async function newPage(): Promise<Page> {
    const page = await browser.newPage();
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    return page;
  }

  async function openTheirs(): Promise<void> {
    await theirs.route(`${kHost}/**`, (route) => {
      const path = decodeURIComponent(new URL(route.request().url()).pathname);
      if (path === '/favicon.ico') return route.fulfill({ status: 204 });
      return route.fulfill({ path: path.startsWith('/block/') ? join(work, 'export', path.slice(7)) : join(viewer, path) });
    });
    const loaded = theirs.waitForEvent('console', (message) => message.text().startsWith('Successfully loaded scene'));
    await theirs.goto(
      `${kHost}/index.html?dir=block&quality=high&near=${near}&s=${kWidth},${kHeight}&vfovy=${kFieldOfView}`);
    await loaded;
    await theirs.waitForFunction(() => gLoadedTextures >= gNumTextures);
    await theirs.waitForLoadState('networkidle');
    // From here on it only draws on request.
    await theirs.evaluate(() => void (window.requestAnimationFrame = () => 0));
  }

  // Its space has y up: (y, z, x) of the scene, whose single block is its cube (src/export/merf_layout.h).
  function merfFromCamera({ matrix }: View): number[] {
    const { rotation: r, scale, translation: t } = tileset.worldFromScene;
    const turned = (v: number[]) => {
      const [x, y, z] = [0, 1, 2].map((row) => r[3 * row] * v[0] + r[3 * row + 1] * v[1] + r[3 * row + 2] * v[2]);
      return [y, z, x];
    };
    const column = (n: number) => matrix.slice(4 * n, 4 * n + 3);
    const place = turned(column(3).map((x, row) => (x - t[row]) / scale));
    return [...turned(column(0)), 0, ...turned(column(1)), 0, ...turned(column(2)), 0, ...place, 1];
  }

  // Returns the seconds of each frame.
  const timeTheirs = (view: View, count: number): Promise<number[]> =>
    theirs.evaluate(({ matrix, frames }) => {
      gCamera.matrixWorld.fromArray(matrix);
      const gl = gRenderer.getContext();
      return Array.from({ length: frames }, () => {
        const begin = performance.now();
        renderProgressively();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        return (performance.now() - begin) / 1000;
      });
    }, { matrix: merfFromCamera(view), frames: count });

  // Returns RGB, rows from the top, as base64: the mean of many frames that are each shifted by a sub-pixel offset.
  const pixelsOfTheirs = (): Promise<string> =>
    theirs.evaluate(() => {
      for (let i = 0; i < 16; ++i) renderProgressively();
      const gl = gRenderer.getContext();
      const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
      const read = new Uint8Array(4 * width * height);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, read);
      let text = '';
      for (let y = height - 1; y >= 0; --y) {
        for (let x = 0; x < width; ++x) text += String.fromCharCode(...read.subarray(4 * (x + width * y), 4 * (x + width * y) + 3));
      }
      return btoa(text);
    });

  async function compare(what: string, views: View[]): Promise<void> {
    const ratios: number[] = [];
    const alike: number[] = [];
    const rows: string[] = [];
    for (const [i, view] of views.entries()) {
      await ours.bringToFront();
      await ours.evaluate((one) => headlessPage.settle(one), view);
      const [a, b]: number[][] = [[], []];
      for (let round = 0; round < kRounds; ++round) {
        a.push(...(await ours.evaluate(([one, count]) => headlessPage.times(one, count), [view, 1 + kFrames] as const)).slice(1));
        b.push(...(await timeTheirs(view, 1 + kFrames)).slice(1));
      }
      const [mine, its] = [await ours.evaluate(() => headlessPage.pixels()), await pixelsOfTheirs()].map((text) => Buffer.from(text, 'base64'));
      for (const [name, pixels] of [['ours', mine], ['merf', its]] as const) {
        writeFileSync(join(pictures, `${what.replaceAll(' ', '-')}-${i}-${name}.ppm`), Buffer.concat([Buffer.from(`P6 ${kWidth} ${kHeight} 255\n`), pixels]));
      }
      const ratio = median(b) / median(a);
      ratios.push(ratio);
      const times = [Math.min(...a), median(a), Math.min(...b), median(b)].map((t) => t.toFixed(3));
      alike.push(psnr(mine, its));
      rows.push(
        `${i}: ours ${times[0]} s (median ${times[1]}), MERF's ${times[2]} s (${times[3]}), of medians ` +
        `${ratio.toFixed(2)} times; images ${alike[i].toFixed(1)} dB apart`);
    }
    console.log([what, ...rows].join('\n'));
    verdict(`${what}: MERF's frame as a multiple of ours, the least`, Math.min(...ratios), '>=', 1);
    verdict(`${what}: the median`, median(ratios), '>=', 1.5);
    verdict(`${what}: images alike, the worst, in dB`, Math.min(...alike), '>=', 20);
  }

  it('renders frames as fast', async () => {
    await theirs.bringToFront();
    await openTheirs();
    await ours.bringToFront();
    await ours.goto(`${server.url}headless.html`);
    await ours.waitForFunction(() => 'headlessPage' in window);
    console.log(`drawn by ${await ours.evaluate(() => headlessPage.gpu())}`);
    await ours.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    await ours.evaluate(() => void (headlessPage.world.background = new headlessPage.THREE.Color(1, 1, 1))); // as in MERF's viewer
    // Inside the scene's box, rays begin at the camera in both viewers.
    const { low, high } = tileset.box;
    const height = low[2] + 0.8 * (high[2] - low[2]);
    const circle = Array.from({ length: 10 }, (_, i) => {
      const at = (turn: number) => [0.7 * Math.cos(turn), 0.7 * Math.sin(turn)] as const;
      return viewAt(tileset, [...at((i / 10) * 2 * Math.PI), height], [...at(((i + 2.5) / 10) * 2 * Math.PI), low[2]]);
    });
    await ours.evaluate((view) => headlessPage.settle(view), circle[0]);
    const sizes = [
      await ours.evaluate(() => [headlessPage.renderer.domElement.width, headlessPage.renderer.domElement.height]),
      await theirs.evaluate(() => [gRenderer.getContext().drawingBufferWidth, gRenderer.getContext().drawingBufferHeight]),
      await theirs.evaluate(() => [gLowResTexture.width, gLowResTexture.height]),
    ];
    expect(sizes).toEqual([[kWidth, kHeight], [kWidth, kHeight], [kWidth, kHeight]]);
    await compare('ten views inside the block', circle);
    await compare('ten held-out views', capturedViews(join(work, 'city'), 10).map(({ view }) => view));
    expect(said).toEqual([]);
  });
});
