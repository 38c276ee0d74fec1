// Compares the viewer with that of MobileNeRF's authors (jax3d, projects/mobilenerf/view_unbounded.html) in one browser, on
// a scene of `mesh` and its export: bench/mesh.sh (ROWS=mobilenerf). Their page is served unchanged, at its own size of
// 1256×828; what it imports from unpkg.com comes from three.js of its time, with a module in between that hands its
// camera and renderer to this file. Frames are drawn on request, alternately, and each ends when the GPU has finished it.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { launch, run, serve, type Server } from '../test/machine';
import { cameraPath, capturedViews, decodePng, psnr } from '../test/pictures';
import { kFieldOfView } from '../test/views';
import { loadTileset } from './against-oracle';
import { needed, verdict } from './verdict';

declare const headlessPage: HeadlessPage;
// What the module in between keeps of the page.
declare const theirPage: {
  camera: {
    matrixAutoUpdate: boolean;
    matrix: { fromArray(numbers: number[]): void };
    projectionMatrix: { fromArray(numbers: number[]): void; clone(): { invert(): object } };
    projectionMatrixInverse: object;
    updateMatrixWorld(force: boolean): void;
  };
  renderer: { domElement: HTMLCanvasElement; getContext(): WebGL2RenderingContext; info: { render: { triangles: number } } };
  target: { width: number; height: number; setSize(width: number, height: number): void };
  scene: { children: { children: { material: { uniforms?: Record<string, { value: { image?: { complete: boolean } } }> } }[] }[] };
  frame: () => void;
};

const scene = needed('SCENE');
const exported = needed('EXPORTED'); // the scene, by `tessera export --format mobilenerf`
const capture = needed('CAPTURE');
const theirHtml = join(needed('JAX3D'), 'jax3d/projects/mobilenerf/view_unbounded.html');
const three = needed('THREE_OF_VIEWER'); // the package three, of a version that still has what the page uses
const out = needed('OUT'); // for images
const viewCount = Number(process.env.VIEWS ?? 5);
const only = process.env.ONLY; // images or frames

const kWidth = 1256; // of their page
const kHeight = 828;
const kScale = 0.1; // of their objects
const kRounds = 3;
const kFrames = 3; // per round
const kHost = 'http://mobilenerf.viewer';
const kUnpkg = 'https://unpkg.com';

const median = (numbers: number[]) => [...numbers].sort((a, b) => a - b)[numbers.length >> 1];

const kInBetween = `
import * as THREE from '${kUnpkg}/three/build/three.module.js';
export * from '${kUnpkg}/three/build/three.module.js';
const theirPage = window.theirPage = {};
export class PerspectiveCamera extends THREE.PerspectiveCamera {
  constructor(...rest) { super(...rest); theirPage.camera = this; }
}
export class WebGLRenderer extends THREE.WebGLRenderer {
  constructor(options) { super({ ...options, preserveDrawingBuffer: true }); theirPage.renderer = this; }
}
export class WebGLMultipleRenderTargets extends THREE.WebGLMultipleRenderTargets {
  constructor(...rest) { super(...rest); theirPage.target = this; }
}
export class Scene extends THREE.Scene {
  constructor() { super(); theirPage.scene ??= this; } // the first is that of the triangles
}`;

// Returns the mean of 2 × 2 pixels.
function halved(pixels: Uint8Array, width: number, height: number): Uint8Array {
  const half = new Uint8Array((3 * width * height) / 4);
  for (let y = 0; y < height / 2; ++y) {
    for (let x = 0; x < width / 2; ++x) {
      for (let c = 0; c < 3; ++c) {
        const at = (column: number, row: number) => pixels[3 * (2 * x + column + width * (2 * y + row)) + c];
        half[3 * (x + (width / 2) * y) + c] = Math.round((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) / 4);
      }
    }
  }
  return half;
}

describe('the viewer beside that of MobileNeRF', () => {
  const tileset = loadTileset(scene);
  const focal = kHeight / 2 / Math.tan((kFieldOfView * Math.PI) / 360);
  const views: View[] = capturedViews(capture, viewCount).map(({ view: { matrix } }) =>
    ({ matrix, fx: focal, fy: focal, cx: kWidth / 2, cy: kHeight / 2, width: kWidth, height: kHeight }));
  let browser: Browser;
  let server: Server;
  const said: string[] = [];

  beforeAll(async () => {
    mkdirSync(out, { recursive: true });
    [browser, server] = await Promise.all([launch(), serve(scene)]);
  });
  afterAll(async () => {
    await browser.close();
    server.close();
  });

  async function newPage(): Promise<Page> {
    const page = await browser.newPage({ viewport: { width: kWidth, height: kHeight } });
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    return page;
  }

  async function openOurs(selection: object): Promise<Page> {
    const ours = await newPage();
    await ours.goto(`${server.url}headless.html`);
    await ours.waitForFunction(() => 'headlessPage' in window);
    await ours.evaluate((options) => headlessPage.open('scene/tileset.json', options), selection);
    return ours;
  }

  async function openTheirs(): Promise<Page> {
    const theirs = await newPage();
    await theirs.route(`${kHost}/**`, (route) => {
      const path = decodeURIComponent(new URL(route.request().url()).pathname);
      if (path === '/favicon.ico') return route.fulfill({ status: 204 });
      return route.fulfill({ path: path.startsWith('/export_phone/') ? join(exported, path.slice(14)) : theirHtml });
    });
    await theirs.route(`${kUnpkg}/**`, (route) => {
      const path = new URL(route.request().url()).pathname;
      const headers = { 'access-control-allow-origin': '*', 'content-type': 'text/javascript' };
      if (path === '/three') return route.fulfill({ headers, body: kInBetween });
      const text = readFileSync(join(three, path.slice('/three/'.length)), 'utf8');
      return route.fulfill({ headers, body: text.replace(/from 'three'/g, `from '${kUnpkg}/three?module'`) });
    });
    // It only draws on request.
    await theirs.addInitScript(() => {
      window.requestAnimationFrame = (draw) => {
        theirPage.frame = () => draw(performance.now());
        return 0;
      };
    });
    await theirs.goto(`${kHost}/view_unbounded.html?obj=export`);
    const { obj_num: shapes } = JSON.parse(readFileSync(join(exported, 'mlp.json'), 'utf8')) as { obj_num: number };
    await theirs.waitForFunction((count) => {
      const { children } = 'theirPage' in window ? theirPage.scene : { children: [] };
      return children.length === count && children.every((shape) => shape.children.every(({ material: { uniforms } }) =>
        uniforms && ['tDiffuse0', 'tDiffuse1'].every((name) => uniforms[name].value.image?.complete)));
    }, shapes, { polling: 500, timeout: 300000 });
    await theirs.waitForLoadState('networkidle');
    return theirs;
  }

  // Their axes are x, z and -y of the scene's, and the blocks lie between -1 and 1 (src/export/mobilenerf.h).
  function lookOfTheirs({ matrix }: View): { matrix: number[]; projection: number[] } {
    const { rotation: r, scale, translation: t } = tileset.worldFromScene;
    const { low, high } = tileset.box;
    const unit = 2 / Math.max(high[0] - low[0], high[1] - low[1]);
    const inScene = (v: number[]) => [0, 1, 2].map((row) => r[3 * row] * v[0] + r[3 * row + 1] * v[1] + r[3 * row + 2] * v[2]);
    const turned = ([x, y, z]: number[]) => [x, z, -y];
    const column = (n: number) => matrix.slice(4 * n, 4 * n + 3);
    const place = inScene(column(3).map((x, row) => (x - t[row]) / scale)).map((x, axis) => kScale * unit * (x - (low[axis] + high[axis]) / 2));
    // Nothing nearer was trained; their depths have 16 bits.
    const near = kScale * unit * tileset.near;
    const far = 4000 * near;
    const [x, y] = [(2 * focal) / kWidth, (2 * focal) / kHeight];
    return {
      matrix: [...turned(inScene(column(0))), 0, ...turned(inScene(column(1))), 0, ...turned(inScene(column(2))), 0, ...turned(place), 1],
      projection: [x, 0, 0, 0, 0, y, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, (2 * near * far) / (near - far), 0],
    };
  }

  // Draws frames and returns the seconds of each.
  const timeTheirs = (theirs: Page, view: View, frames: number): Promise<number[]> =>
    theirs.evaluate(({ look, count }) => {
      const { camera, renderer } = theirPage;
      camera.matrixAutoUpdate = false;
      camera.matrix.fromArray(look.matrix);
      camera.updateMatrixWorld(true);
      camera.projectionMatrix.fromArray(look.projection);
      camera.projectionMatrixInverse = camera.projectionMatrix.clone().invert();
      const gl = renderer.getContext();
      return Array.from({ length: count }, () => {
        const begin = performance.now();
        theirPage.frame();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        return (performance.now() - begin) / 1000;
      });
    }, { look: lookOfTheirs(view), count: frames });

  // The views differ slightly from frame to frame, as frames at rest are not drawn for ever.
  const timeOurs = async (ours: Page, view: View, frames: number): Promise<number[]> =>
    ours.evaluate((some) => some.map((one) => headlessPage.time(one, 1)),
      Array.from({ length: frames }, (_, i) => ({ ...view, cx: view.cx + 0.01 * (i + 1) })));

  async function savePicture(page: Page, name: string): Promise<Uint8Array> {
    const url = await page.evaluate(() => document.querySelector('canvas')!.toDataURL());
    writeFileSync(join(out, name), Buffer.from(url.slice(url.indexOf(',') + 1), 'base64'));
    return decodePng(page, join(out, name));
  }

  it.skipIf(only === 'frames')('shows the same images as the CPU', async () => {
    const path = join(out, 'path.json');
    // Four places of a pixel, those that their viewer samples.
    writeFileSync(path, cameraPath(tileset, views.map(({ matrix }) => matrix), 2 * kWidth, 2 * kHeight));
    run('render', scene, join(out, 'oracle'), '--path', path);
    const theirs = await openTheirs();
    const whole: number[] = [];
    const covered: number[] = [];
    for (const [i, view] of views.entries()) {
      await timeTheirs(theirs, view, 1);
      const actual = await savePicture(theirs, `mobilenerf-${i}.png`);
      const expected = halved(await decodePng(theirs, join(out, 'oracle', `${String(i).padStart(5, '0')}.png`)), 2 * kWidth, 2 * kHeight);
      whole.push(psnr(actual, expected));
      const isShown = (at: number) => [0, 1, 2].some((c) => actual[at - (at % 3) + c] < 255);
      covered.push(psnr(actual.filter((_, at) => isShown(at)), expected.filter((_, at) => isShown(at))));
      const share = actual.reduce((sum, _, at) => sum + (isShown(at) ? 1 : 0), 0) / actual.length;
      console.log(`${i}: ${whole[i].toFixed(1)} dB, of the ${(100 * share).toFixed(2)} % of pixels that it covers ${covered[i].toFixed(1)} dB`);
    }
    await theirs.close();
    expect.soft(said.splice(0)).toEqual([]);
    verdict('their viewer against the CPU, where it shows something, the mean of views, in dB', covered.reduce((a, b) => a + b) / covered.length, '>=', 27);
  });

  it.skipIf(only === 'images')('draws frames faster', async () => {
    const finest = await openOurs({ selection: { maximumScreenSpaceError: 0, finestLevel: 0 } });
    const selected = await openOurs({});
    const theirs = await openTheirs();
    console.log(`drawn by ${await finest.evaluate(() => headlessPage.gpu())}`);
    const times: Record<string, number[]> = { finest: [], selected: [], theirs: [], single: [] }; // of each view, the median
    for (const [i, view] of views.entries()) {
      for (const ours of [finest, selected]) await ours.evaluate((one) => headlessPage.settle(one, 600000), view);
      await savePicture(finest, `ours-${i}.png`);
      const all: Record<string, number[]> = { finest: [], selected: [], theirs: [], single: [] };
      for (let round = 0; round < kRounds; ++round) {
        await finest.bringToFront();
        all.finest.push(...(await timeOurs(finest, view, 1 + kFrames)).slice(1));
        await selected.bringToFront();
        all.selected.push(...(await timeOurs(selected, view, 1 + kFrames)).slice(1));
        await theirs.bringToFront();
        for (const [name, samples] of [['theirs', 2], ['single', 1]] as const) {
          await theirs.evaluate((size) => theirPage.target.setSize(...size), [samples * kWidth, samples * kHeight] as [number, number]);
          all[name].push(...(await timeTheirs(theirs, view, 1 + kFrames)).slice(1));
        }
      }
      const said = Object.entries(all).map(([name, seconds]) => {
        times[name].push(median(seconds));
        return `${name} ${median(seconds).toFixed(3)} s (best ${Math.min(...seconds).toFixed(3)})`;
      });
      console.log(`${i}: ${said.join(', ')}`);
    }
    for (const [name, what] of [['finest', 'ours, finest level'], ['selected', 'ours, levels as selected']]) {
      const ratios = (other: string) => times[other].map((seconds, i) => seconds / times[name][i]);
      console.log(`${what}: MobileNeRF's frame with one sample of a pixel in place of four as a multiple of ours, median of views: ${median(ratios('single')).toFixed(2)}`);
      if (name === 'finest') verdict(`${what}: MobileNeRF's frame as a multiple of ours, median of views`, median(ratios('theirs')), '>=', 1.5);
      else console.log(`${what}: MobileNeRF's frame as a multiple of ours, median of views: ${median(ratios('theirs')).toFixed(2)}`);
    }
    for (const page of [finest, selected, theirs]) await page.close();
    expect.soft(said.splice(0)).toEqual([]);
  });
});
