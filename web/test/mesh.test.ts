// Tests features of `mesh` scenes in the browser that other scenes do not have, and whatever depends on how they are drawn.
import { readFileSync } from 'node:fs';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { kMeshModes } from '../src/representations/mesh/mesh-modes';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { countGpuMemory, type GpuMemory } from './gpu-memory';
import { goldenMesh, launch, missing, serve, type Server } from './machine';
import { isSame, psnr } from './pictures';
import { openHeadlessPage } from './open-headless-page';
import { viewAt, type Place } from './views';

declare const headlessPage: HeadlessPage;
declare const gpuMemory: GpuMemory;

describe.skipIf(missing())('a scene of mesh', () => {
  let server: Server;
  let browser: Browser;
  let page: Page;
  const said: string[] = [];
  const tileset = decodeTileset(readFileSync(`${goldenMesh}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
  // Smaller than those of other tests, and off-centre.
  const view = (eye: Place, target: Place): View => ({ ...viewAt(tileset, eye, target), cx: 126, width: 240, cy: 80, height: 160 });
  const atFacade = view([-1, -2.2, 0.3], [-1, 0, 0.1]);
  const above = view([0.3, -2.5, 1.5], [0, 0, -0.4]);

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenMesh), launch()]);
    page = await openHeadlessPage(browser, server, said);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    await page.evaluate(() => (headlessPage.city!.framesAtRest = 8));
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    expect(said).toEqual([]);
  });

  const shown = async () => new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
  async function picture(views: View | View[]): Promise<Uint8Array> {
    await page.evaluate((some) => headlessPage.settle(some), views);
    return shown();
  }
  // Draws one frame of a motion.
  async function frame(one: View): Promise<Uint8Array> {
    await page.evaluate((at) => headlessPage.times(at, 1), one);
    return shown();
  }

  it('has the same image each time that a view comes to rest', async () => {
    const first = await picture(atFacade);
    await picture(above);
    expect(isSame(await picture(atFacade), first)).toBe(true);
    await page.evaluate(() => headlessPage.loseGpu());
    expect(isSame(await picture(atFacade), first)).toBe(true);
  });

  it('has less noise at rest than in one frame, and in motion, too', async () => {
    const along = (i: number) => view([-1 + 0.002 * i, -2.2, 0.3], [-1 + 0.002 * i, 0, 0.1]);
    await picture(view([6, 3, 0.5], [0, 0, 0])); // far away, so that the next frame has no history
    const single = await frame(along(0));
    for (let i = 1; i < 6; ++i) await frame(along(i));
    const moving = await frame(along(6));
    await page.evaluate(() => (headlessPage.city!.framesAtRest = 64));
    const resting = await picture(along(6));
    const restingAtFirst = await picture(along(0));
    await page.evaluate(() => (headlessPage.city!.framesAtRest = 8));
    expect(psnr(single, restingAtFirst)).toBeGreaterThan(15);
    expect(psnr(moving, resting)).toBeGreaterThan(psnr(single, restingAtFirst) + 1);
    expect(psnr(await picture(along(6)), resting)).toBeGreaterThan(psnr(moving, resting) + 3);
  });

  it('has smooth edges at rest', async () => {
    const far = view([6, 3, 0.5], [0, 0, 0]);
    const set = (framesAtRest: number, antialiases: boolean, scale: number) => page.evaluate(([n, smooth, one]) =>
      Object.assign(headlessPage.city!, { framesAtRest: n, antialiases: smooth, resolutionScale: one }), [framesAtRest, antialiases, scale] as const);
    await set(24, false, 2);
    const fine = await picture(far); // the display takes the mean of four samples
    await set(24, false, 1);
    const rough = await picture(far);
    await set(24, true, 1);
    const smooth = await picture(far);
    await set(8, true, 1);
    expect(psnr(smooth, fine)).toBeGreaterThan(psnr(rough, fine) + 2);
  });

  it('shows each camera of several what it shows it alone', async () => {
    const views = [view([-1.05, -2.2, 0.3], [-1, 0, 0.1]), view([1.5, 0.9, 0.6], [3, 2, 0.3])];
    const together = await picture(views);
    const row = 3 * 480;
    for (const [i, one] of views.entries()) {
      const part = new Uint8Array(3 * 240 * 160);
      for (let y = 0; y < 160; ++y) part.set(together.subarray(y * row + i * 720, y * row + (i + 1) * 720), 720 * y);
      const alone = await picture(one);
      expect(new Set(alone).size).toBeGreaterThan(20); // something is visible
      expect(psnr(part, alone)).toBeGreaterThan(60);
    }
  });

  it.each(kMeshModes.slice(1))('shows other colours in the mode $name', async ({ name }) => {
    const colours = await picture(atFacade);
    await page.evaluate((mode) => (headlessPage.city!.display = mode), name);
    const others = await picture(atFacade);
    await page.evaluate(() => (headlessPage.city!.display = 'colour'));
    expect(new Set(others).size).toBeGreaterThan(5);
    expect(psnr(colours, others)).toBeLessThan(33);
  });

  it('draws nothing in hidden boxes', async () => {
    const whole = await picture(atFacade);
    const hide = (...boxes: { low: number[]; high: number[] }[]) => page.evaluate((all) => headlessPage.hide(all), boxes);
    await hide({ low: [-1.5, -0.4, -0.05], high: [-0.5, 0.4, 0.6] });
    const without = await picture(atFacade);
    const changed = whole.filter((value, i) => Math.abs(value - without[i]) > 8).length / whole.length;
    expect(changed).toBeGreaterThan(0.02);
    expect(changed).toBeLessThan(0.2);
    await hide({ low: [-1.5, -0.4, 50], high: [-0.5, 0.4, 60] });
    expect(isSame(await picture(atFacade), whole)).toBe(true);
    await hide();
  });

  it('draws a content that is shown in place of several tiles in each of them', async () => {
    // Cuts the box of each tile in two, and draws these pieces of it.
    const drawPieces = async (pieces: number[]) => {
      await page.evaluate(async ([one, some]) => {
        const { drawer } = headlessPage.city as any;
        const draw = drawer.draw.bind(drawer) as (view: any, settings: any) => boolean;
        drawer.draw = (all: any, settings: any) => draw({
          ...all,
          contents: all.contents.map((parts: any[]) => parts.flatMap(({ content }) => {
            const far = 1e9;
            const middle = 0.5 * ((content.box.low[0] as number) + (content.box.high[0] as number));
            const limits = [[-far, middle], [middle, far]];
            return content.isBackground ? [] : some.map((n) => (
              { content, within: { low: [limits[n][0], -far, -far], high: [limits[n][1], far, far] } }));
          })),
        }, settings);
        await headlessPage.settle(one);
        delete drawer.draw;
      }, [above, pieces] as const);
      return shown();
    };
    await page.evaluate(() => (headlessPage.city!.showsBackgroundBlock = false));
    const whole = await picture(above);
    expect(psnr(await drawPieces([0, 1]), whole)).toBeGreaterThan(50);
    const [left, right] = [await drawPieces([0]), await drawPieces([1])];
    await page.evaluate(() => (headlessPage.city!.showsBackgroundBlock = true));
    expect(psnr(left, whole)).toBeLessThan(30);
    expect(psnr(right, whole)).toBeLessThan(30);
    // Each pixel is that of one of the pieces, apart from what shows through.
    const isIn = (image: Uint8Array, i: number) => Math.abs(image[i] - whole[i]) < 6;
    expect(whole.filter((_, i) => isIn(left, i) || isIn(right, i)).length / whole.length).toBeGreaterThan(0.9);
  });

  it('draws a content that fades in its share of the pixels, and the other content in the rest', async () => {
    const drawShare = async (share: [number, number]) => {
      await page.evaluate(([one, of]) => {
        const { drawer } = headlessPage.city as any;
        const draw = drawer.draw.bind(drawer) as (view: any, settings: any) => boolean;
        drawer.draw = (all: any, settings: any) => draw({
          ...all,
          contents: all.contents.map((parts: any[]) => parts.filter(({ content }) => !content.isBackground).map(({ content }) => ({ content, share: of }))),
        }, settings);
        // The same thresholds each time, and no frame before.
        drawer.last = undefined;
        drawer.framesInMotion = 0;
        headlessPage.times(one, 1);
        delete drawer.draw;
      }, [above, share] as const);
      return shown();
    };
    await picture(above);
    const whole = await drawShare([0, 1]);
    const [first, rest, none] = [await drawShare([0, 0.25]), await drawShare([0.25, 1]), await drawShare([0, 0])];
    let [ofFirst, ofRest, others] = [0, 0, 0];
    for (let i = 0; i < whole.length; i += 3) {
      const isEqual = (a: Uint8Array, b: Uint8Array) => [0, 1, 2].every((c) => Math.abs(a[i + c] - b[i + c]) < 2);
      if (isEqual(whole, none)) continue;
      if (isEqual(first, whole) && isEqual(rest, none)) ++ofFirst;
      else if (isEqual(rest, whole) && isEqual(first, none)) ++ofRest;
      else ++others;
    }
    expect(ofFirst + ofRest).toBeGreaterThan(2000);
    expect(others / (ofFirst + ofRest)).toBeLessThan(0.01);
    expect(Math.abs(ofFirst / (ofFirst + ofRest) - 0.25)).toBeLessThan(0.03);
  });

  // Where a box stands just in front of what `pick` returns, it is visible, and just behind it hidden.
  it.each([[0.5, -0.55], [-0.4, -0.6], [0.3, -0.7]])('has its surface where it is picked, at %f, %f', async (x, y) => {
    // Something half-transparent in front is drawn in as many frames as its opacity says, within one.
    await page.evaluate(() => (headlessPage.city!.framesAtRest = 32));
    const without = await picture(atFacade);
    const place = await page.evaluate(([a, b]) => headlessPage.surfaceAt(a, b), [x, y]);
    expect(place).toBeDefined();
    const eye = [-1, -2.2, 0.3];
    const distance = Math.hypot(...place!.map((one, a) => one - eye[a]));
    const edge = 0.004 * distance;
    const pixel = 3 * (Math.floor((0.5 - 0.5 * y) * 160) * 240 + Math.floor((0.5 + 0.5 * x) * 240));
    const boxAt = async (share: number) => {
      const middle = place!.map((one, a) => eye[a] + share * (one - eye[a]));
      await page.evaluate(([low, high]) => headlessPage.addBox(low, high), [middle.map((one) => one - edge), middle.map((one) => one + edge)]);
      const pixels = await picture(atFacade);
      await page.evaluate(() => headlessPage.removeBox());
      return [...pixels.subarray(pixel, pixel + 3)];
    };
    const [red, green] = await boxAt(1 - 0.02);
    expect(red).toBeGreaterThan(235);
    expect(green).toBeLessThan(20);
    const behind = await boxAt(1 + 0.04);
    await page.evaluate(() => (headlessPage.city!.framesAtRest = 8));
    behind.forEach((value, c) => expect(Math.abs(value - without[pixel + c])).toBeLessThan(9));
  });

  it('hides what is behind a model, and a model that is behind it, in parallel projections, too', async () => {
    const { scale } = tileset.worldFromScene;
    const parallel: View = { ...above, isParallel: true, fx: above.fx / (2 * scale), fy: above.fy / (2 * scale) };
    for (const one of [above, parallel]) {
      const without = await picture(one);
      await page.evaluate(() => headlessPage.addBox([-0.3, -1.3, 0.3], [0.4, -1.1, 0.8]));
      await page.evaluate(() => (headlessPage.city!.visible = false));
      const alone = await picture(one);
      await page.evaluate(() => (headlessPage.city!.visible = true));
      const inFront = await picture(one);
      await page.evaluate(() => headlessPage.removeBox());
      await page.evaluate(() => headlessPage.addBox([0, 0.4, -1.1], [0.3, 0.6, -0.9])); // below the ground
      const behind = await picture(one);
      await page.evaluate(() => headlessPage.removeBox());
      const isRed = (pixels: Uint8Array, at: number) => pixels[at] > 235 && pixels[at + 1] < 20;
      const counts = { covered: 0, red: 0, same: 0, changed: 0 };
      for (let at = 0; at < alone.length; at += 3) {
        const difference = (other: Uint8Array) => Math.max(...[0, 1, 2].map((c) => Math.abs(other[at + c] - without[at + c])));
        if (isRed(alone, at)) ++counts.covered;
        if (isRed(alone, at) && isRed(inFront, at)) ++counts.red;
        if (!isRed(alone, at) && difference(inFront) < 9) ++counts.same;
        if (difference(behind) > 40) ++counts.changed;
      }
      const pixels = alone.length / 3;
      expect(counts.covered).toBeGreaterThan(pixels / 10);
      expect(counts.red).toBeGreaterThan(0.99 * counts.covered);
      expect(counts.same).toBeGreaterThan(0.97 * (pixels - counts.covered)); // but for soft edges
      expect(counts.changed).toBeLessThan(0.01 * pixels);
    }
  });

  it('draws solid surfaces in motion only for what they may hide, and for picking', async () => {
    let nudge = 0;
    const countTriangles = async () => page.evaluate((one) => {
      const { info } = headlessPage.renderer;
      info.autoReset = false;
      info.reset();
      headlessPage.times(one, 1);
      info.autoReset = true;
      return info.render.triangles;
    }, { ...atFacade, cx: atFacade.cx + 0.01 * ++nudge });
    await picture(atFacade);
    const alone = await countTriangles();
    await page.evaluate(() => headlessPage.addBox([-1.15, 0.5, 0], [-0.85, 0.7, 0.3])); // behind the facade
    const withOpaque = await countTriangles();
    const reds = (pixels: Uint8Array) => pixels.filter((value, at) => at % 3 === 0 && value > 235 && pixels[at + 1] < 20).length;
    await page.evaluate(() => ((headlessPage.world.getObjectByName('box') as any).material.transparent = true));
    const atRest = reds(await picture(atFacade)); // between what is solid
    const withTransparent = await countTriangles();
    const inMotion = reds(await shown());
    expect(atRest).toBeGreaterThan(100);
    expect(Math.abs(inMotion - atRest)).toBeLessThan(20);
    await page.evaluate(() => headlessPage.removeBox());
    const others = 40; // of boxes and passes over the picture
    expect(Math.abs(withOpaque - alone)).toBeLessThan(others);
    expect(withTransparent).toBeGreaterThan(1.8 * alone - others);
    expect(alone).toBeGreaterThan(10 * others);

    const at = [0.5, -0.55] as const;
    await picture(atFacade);
    const resting = await page.evaluate(([x, y]) => headlessPage.surfaceAt(x, y), at);
    await picture(above);
    await frame(atFacade);
    expect(await page.evaluate(([x, y]) => headlessPage.surfaceAt(x, y), at)).toEqual(resting);
  });

  it('follows models that move while the camera rests', async () => {
    await page.evaluate(() => headlessPage.addBox([-1.15, -0.8, 0], [-0.85, -0.6, 0.3]));
    const reds = (pixels: Uint8Array) => pixels.filter((value, at) => at % 3 === 0 && value > 235 && pixels[at + 1] < 20).length;
    const before = reds(await picture(atFacade));
    expect(before).toBeGreaterThan(200);
    await page.evaluate(() => headlessPage.world.getObjectByName('box')!.translateX(0.3));
    await page.evaluate(() => headlessPage.world.getObjectByName('box')!.updateMatrix());
    const moved = await picture(atFacade);
    await page.evaluate(() => headlessPage.city!.leaveGpu()); // draws all anew
    expect(psnr(await picture(atFacade), moved)).toBeGreaterThan(45);
    await page.evaluate(() => headlessPage.removeBox());
  });

  it('follows models whose shapes change while the camera rests', async () => {
    await page.evaluate(() => headlessPage.addCubes([{ middle: [0, 0, 0], half: 0.01 }]));
    await picture(atFacade);
    await page.evaluate(() => {
      const cubes = headlessPage.world.getObjectByName('box') as any;
      const { THREE, city } = headlessPage;
      const place = new THREE.Vector3(-1, -0.8, 0.2).applyMatrix4(city!.localFromScene).applyMatrix4(cubes.matrix.clone().invert());
      cubes.setMatrixAt(0, new THREE.Matrix4().makeScale(9, 9, 9).setPosition(place));
      cubes.instanceMatrix.needsUpdate = true;
    });
    const reds = (pixels: Uint8Array) => pixels.filter((value, at) => at % 3 === 0 && value > 235 && pixels[at + 1] < 20).length;
    expect(reds(await picture(atFacade))).toBeGreaterThan(200);
    await page.evaluate(() => headlessPage.removeBox());
  });

  it('stays within the budget of GPU memory, and is freed afterwards', async () => {
    const other = await browser.newPage();
    await other.addInitScript(countGpuMemory);
    await other.goto(`${server.url}headless.html`);
    await other.waitForFunction(() => 'headlessPage' in window);
    const open = async (stream: { gpuBytes?: number }) => {
      await other.evaluate((one) => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0.01 }, stream: one }), stream);
      await other.evaluate(() => (headlessPage.city!.framesAtRest = 2));
    };
    await open({});
    await other.evaluate((one) => headlessPage.settle(one), above);
    const all = await other.evaluate(() => headlessPage.city!.statistics!);
    expect(all.drawn).toEqual([2, 0]);
    await other.evaluate(() => headlessPage.close());
    const own = await other.evaluate(() => gpuMemory.bytes);
    const budget = Math.round(all.gpuBytes * 0.85) + all.targetBytes;
    await open({ gpuBytes: budget });
    await other.evaluate(() => (gpuMemory.maximum = gpuMemory.bytes));
    const over = (x: number) => view([x, 0.02, 0.1], [x, 0, -0.7]);
    const levels: number[][] = [];
    for (const one of [over(-1), above, over(1), above, over(-1.02)]) {
      await other.evaluate((at) => headlessPage.settle(at), one);
      const [maximum, { drawn }] = await other.evaluate(() => [gpuMemory.maximum, headlessPage.city!.statistics!] as const);
      expect(maximum - own).toBeLessThanOrEqual(budget);
      levels.push(drawn);
    }
    expect(levels).toContainEqual([1, 0]);
    expect(levels).not.toContainEqual([2, 0]); // both do not fit
    expect(await other.evaluate(() => headlessPage.errors)).toEqual([]);
    await other.evaluate(() => headlessPage.close());
    expect(await other.evaluate(() => gpuMemory.bytes)).toBeLessThanOrEqual(own * 1.05);
    await other.close();
  });
});
