// Measures `mesh` scenes in a browser: bench/mesh.sh (ROWS=browser).
import { join } from 'node:path';
import * as THREE from 'three';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { launch, serve, type Server } from '../test/machine';
import { capturedViews } from '../test/pictures';
import { againstOracle, loadTileset, tell } from './against-oracle';
import { placesOfDepth } from './true-depth';
import { needed, verdict } from './verdict';

declare const headlessPage: HeadlessPage;

const scene = needed('SCENE');
const capture = needed('CAPTURE'); // synthetic, with true depth
const volume = process.env.VOLUME; // a scene of `volume` of the same place, for comparison
const out = needed('OUT'); // for images

const kFrames = 7; // of which the fastest counts

function enlarged(view: View, times: number): View {
  const { fx, fy, cx, cy, width, height } = view;
  return { ...view, fx: times * fx, fy: times * fy, cx: times * cx, cy: times * cy, width: times * width, height: times * height };
}

function median(values: number[]): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)];
}

describe('the viewer', () => {
  let browser: Browser;
  let server: Server;
  const said: string[] = [];

  beforeAll(async () => {
    browser = await launch();
  });
  afterAll(() => browser.close());

  async function open(folder: string): Promise<Page> {
    server = await serve(folder);
    const page = await browser.newPage();
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.goto(`${server.url}headless.html`);
    await page.waitForFunction(() => 'headlessPage' in window);
    return page;
  }
  async function close(page: Page): Promise<void> {
    await page.close();
    server.close();
    expect.soft(said.splice(0)).toEqual([]);
  }

  // Returns the seconds of a frame in motion, in each view, and the triangles that are drawn. The views differ slightly from
  // frame to frame, as frames at rest are not drawn for ever.
  async function timeFrames(page: Page, views: View[], frames = kFrames): Promise<{ seconds: number[]; triangles: number[] }> {
    const seconds: number[] = [];
    const triangles: number[] = [];
    await page.evaluate(() => (headlessPage.city!.framesAtRest = 1));
    for (const view of views) {
      await page.evaluate((one) => headlessPage.settle(one), view);
      const moved = Array.from({ length: frames }, (_, i) => ({ ...view, cx: view.cx + 0.01 * (i + 1) }));
      seconds.push(await page.evaluate((some) => Math.min(...some.map((one) => headlessPage.time(one, 1))), moved));
      triangles.push(await page.evaluate((one) => {
        const { info } = headlessPage.renderer;
        info.autoReset = false;
        info.reset();
        headlessPage.time(one, 1);
        info.autoReset = true;
        return info.render.triangles;
      }, { ...view, cx: view.cx - 0.01 }));
    }
    return { seconds, triangles };
  }

  it('draws held-out views as the CPU does', async () => {
    const page = await open(scene);
    console.log(`drawn by ${await page.evaluate(() => headlessPage.gpu())}`);
    const { decibels } = await againstOracle(page, scene, capture, join(out, 'views'));
    await close(page);
    tell(decibels, []);
    verdict('64 frames in ten held-out views, the worst, in dB', Math.min(...decibels), '>=', 38);
  });

  it('measures distances between picked places', async () => {
    const page = await open(scene);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    const { tiles, worldFromScene: { rotation: r, scale, translation: t } } = loadTileset(scene);
    const texel = Math.max(...tiles.filter(({ level }) => level === 0).map(({ geometricError }) => geometricError)); // metres
    const errors: number[] = [];
    const ratios: number[] = [];
    let [measured, real] = [0, 0];
    for (const { view, lens, depthFile } of capturedViews(capture, 10)) {
      await page.evaluate((one) => headlessPage.settle(one), view);
      const picked: [THREE.Vector3, THREE.Vector3][] = [];
      for (const { place, pixel: [x, y] } of placesOfDepth(join(capture, depthFile), lens, view)) {
        // Both are of the middle of the pixel.
        const surface = await page.evaluate(
          ([a, b]) => headlessPage.surfaceAt(a, b), [(2 * (x + 0.5)) / view.width - 1, 1 - (2 * (y + 0.5)) / view.height]);
        if (!surface) continue;
        const inWorld = [0, 1, 2].map((row) => scale * (r[row] * surface[0] + r[3 + row] * surface[1] + r[6 + row] * surface[2]) + t[row]);
        picked.push([new THREE.Vector3(...inWorld), new THREE.Vector3(...place)]);
      }
      // Ten pairs of each view.
      for (let i = 0; i < 10 && picked.length > 1; ++i) {
        const [[a, trueA], [b, trueB]] = [picked[(7 * i) % picked.length], picked[(7 * i + Math.floor(picked.length / 2)) % picked.length]];
        const [distance, truth] = [a.distanceTo(b), trueA.distanceTo(trueB)];
        errors.push(Math.abs(distance - truth));
        ratios.push(distance / truth);
        measured += distance;
        real += truth;
      }
    }
    await close(page);
    console.log(`${errors.length} distances of ${(real / errors.length).toFixed(1)} m on average; a texel is ${texel.toFixed(3)} m wide`);
    verdict('median error of a distance, in texels', median(errors) / texel, '<=', 1);
    // A place that is picked through a gap is far away, and says nothing of the scale.
    verdict('error of the scale: of the median ratio', Math.abs(median(ratios) - 1), '<=', 0.001);
    const outliers = errors.filter((error) => error > 10 * texel).length;
    console.log(`error of the sum of all distances ${(measured / real - 1).toFixed(4)}; ${outliers} are off by more than ten texels`);
  });

  it('draws few triangles in each level', async () => {
    const views = capturedViews(capture, 5).map(({ view }) => view);
    const { levels } = loadTileset(scene);
    for (let level = 0; level < levels; ++level) {
      const page = await open(scene);
      await page.evaluate(
        (finestLevel) => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0, finestLevel } }), level);
      const { seconds, triangles } = await timeFrames(page, views);
      await close(page);
      console.log(`level ${level}: a frame ${median(seconds).toFixed(3)} s, ${median(triangles)} triangles`);
    }
    const page = await open(scene);
    await page.evaluate(() => headlessPage.open('scene/tileset.json'));
    const { seconds, triangles } = await timeFrames(page, views);
    await close(page);
    console.log(`levels as selected: a frame ${median(seconds).toFixed(3)} s, ${median(triangles)} triangles`);
  });

  it('decodes fewer pixels where a model hides the scene', async () => {
    const views = capturedViews(capture, 5).map(({ view }) => enlarged(view, 2));
    const page = await open(scene);
    await page.evaluate(() => headlessPage.open('scene/tileset.json'));
    // What is as magenta as the background and the model is not decoded.
    await page.evaluate(() => (headlessPage.world.background = new headlessPage.THREE.Color(0xff00ff)));
    const decoded = async (view: View) => {
      await page.evaluate((one) => headlessPage.times(one, 1), { ...view, cx: view.cx - 0.02 });
      const pixels = new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
      let others = 0;
      for (let i = 0; i < pixels.length; i += 3) others += pixels[i] === 255 && pixels[i + 1] === 0 && pixels[i + 2] === 255 ? 0 : 1;
      return (3 * others) / pixels.length;
    };
    const [times, shares]: number[][] = [[], []];
    for (const view of views) {
      const alone = (await timeFrames(page, [view])).seconds[0];
      const shareAlone = await decoded(view);
      await page.evaluate(() => {
        const { THREE: { BufferGeometry, DoubleSide, Mesh, MeshBasicMaterial, Vector3 }, camera, world } = headlessPage;
        const depth = new Vector3(0, 0, -2).applyMatrix4(camera.projectionMatrix).z; // 2 m away
        const corners = [[-1, -1], [-1 / 3, -1], [-1 / 3, 1], [-1, -1], [-1 / 3, 1], [-1, 1]];
        const geometry = new BufferGeometry().setFromPoints(corners.map(([x, y]) => new Vector3(x, y, depth).unproject(camera)));
        const model = new Mesh(geometry, new MeshBasicMaterial({ color: 0xff00ff, side: DoubleSide }));
        model.name = 'model';
        world.add(model);
      });
      times.push((await timeFrames(page, [view])).seconds[0] / alone);
      shares.push((await decoded(view)) / shareAlone);
      await page.evaluate(() => headlessPage.world.getObjectByName('model')!.removeFromParent());
    }
    await close(page);
    console.log(`with a model that covers a third of ${views[0].width}x${views[0].height}: a frame takes ${median(times).toFixed(2)} times as long`);
    verdict('pixels that are decoded, relative to those without the model', median(shares), '<=', 0.7);
  });

  // Vertices cost the same at each size, so `mesh` gains with the number of pixels.
  it.skipIf(!volume).each([1, 2, 4])('is faster than volume of the same place, with images of %i times the size', async (times) => {
    const views = capturedViews(capture, 5).map(({ view }) => enlarged(view, times));
    const seconds: number[] = [];
    let pixels = 0;
    for (const folder of [scene, volume!]) {
      const page = await open(folder);
      await page.evaluate(() => headlessPage.open('scene/tileset.json'));
      const timed = await timeFrames(page, views, times === 1 ? kFrames : 3);
      seconds.push(median(timed.seconds));
      if (folder === scene) pixels = (views[0].width * views[0].height) / median(timed.triangles);
      await close(page);
    }
    console.log(`a frame of ${views[0].width}x${views[0].height}: mesh ${seconds[0].toFixed(3)} s, volume ${seconds[1].toFixed(3)} s`);
    verdict('pixels for a triangle', pixels, '>=', 8);
    verdict('time of a frame of volume relative to mesh', seconds[1] / seconds[0], '>=', 2);
  });
});
