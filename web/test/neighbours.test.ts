// Tests hidden parts of a scene, and several scenes side by side. By pixels.
import { readFileSync } from 'node:fs';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenHash, goldenScene, launch, missing, serve, type Server } from './machine';
import { isSame } from './pictures';
import { openHeadlessPage } from './open-headless-page';
import { viewAt } from './views';

declare const headlessPage: HeadlessPage;

const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
const options = { selection: { maximumScreenSpaceError: 0 } };
const kBackgrounds = [0xff00ff, 0x00ff00];

describe.skipIf(missing()).each([['volume', goldenScene], ['hash', goldenHash]])('in one world, of a scene of %s,', (_, golden) => {
  let server: Server;
  let browser: Browser;
  let page: Page;
  const said: string[] = [];

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(golden), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    expect(said).toEqual([]);
  });

  async function open(): Promise<void> {
    page = await openHeadlessPage(browser, server, said);
    await page.evaluate((one) => headlessPage.open('scene/tileset.json', one), options);
  }

  async function picture(view: View): Promise<Uint8Array> {
    await page.evaluate((one) => headlessPage.settle(one), view);
    return new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
  }

  const differs = (a: Uint8Array, b: Uint8Array, pixel: number, by = 4) =>
    [0, 1, 2].some((c) => Math.abs(a[3 * pixel + c] - b[3 * pixel + c]) > by);
  const pixelIndices = (image: Uint8Array) => Array.from({ length: image.length / 3 }, (_, pixel) => pixel);

  describe('the hidden part', () => {
    beforeAll(open);
    beforeEach(() => page.evaluate(() => {
      headlessPage.hide([]);
      headlessPage.world.background = headlessPage.city!.background;
    }));
    afterAll(() => page.close());

    // In the golden scene a building occupies |x + 1| < 0.4, |y| < 0.3, up to z = 0.45.
    const building = { low: [-1.5, -0.4, -0.05], high: [-0.5, 0.4, 0.6] };
    const atFacade = viewAt(tileset, [-1, -2.2, 0.3], [-1, 0, 0.1]);
    const hide = (...boxes: { low: number[]; high: number[] }[]) => page.evaluate((all) => headlessPage.hide(all), boxes);

    it('is not drawn and occludes no model; the rest is unchanged', async () => {
      const whole = await picture(atFacade);
      await page.evaluate(() => headlessPage.addBox([-1.1, 0.55, 0.1], [-0.9, 0.65, 0.3]));
      const isRed = (image: Uint8Array, pixel: number) => image[3 * pixel] > 235 && image[3 * pixel + 1] < 20;
      const redIn = (image: Uint8Array) => pixelIndices(image).filter((pixel) => isRed(image, pixel)).length;
      expect(redIn(await picture(atFacade))).toBe(0);
      await hide(building);
      const without = await picture(atFacade);
      expect(redIn(without)).toBeGreaterThan(250);
      const edges = [0, 1, 2, 3, 4, 5, 6, 7].map((n) => [0, 1, 2].map((a) => (n & (1 << a) ? building.high : building.low)[a]));
      const columns = edges.map(([x, y]) => 240 + (270 / 2 / Math.tan(Math.PI / 6)) * ((x + 1) / (y + 2.2)));
      const isBeside = (pixel: number) => pixel % 480 < Math.min(...columns) - 1 || pixel % 480 > Math.max(...columns) + 1;
      expect(pixelIndices(whole).filter(isBeside).length).toBeGreaterThan(20000);
      expect(pixelIndices(whole).filter((pixel) => isBeside(pixel) && differs(whole, without, pixel)).length).toBe(0);
      await page.evaluate(() => headlessPage.removeBox());
      await hide();
      expect(isSame(await picture(atFacade), whole)).toBe(true);
    });

    it('is empty if boxes contain nothing or are degenerate', async () => {
      const whole = await picture(atFacade);
      await hide({ low: [-1.5, -0.4, 50], high: [-0.5, 0.4, 60] }, { low: [-1, -1, -1], high: [1, 1, -1] });
      expect(isSame(await picture(atFacade), whole)).toBe(true);
    });

    it('is the union of overlapping boxes', async () => {
      const slab = (from: number, to: number) => ({ low: [from, -0.4, -0.05], high: [to, 0.4, 0.6] });
      await hide(building);
      const whole = await picture(atFacade);
      await hide(slab(-0.8, -0.5), slab(-1.5, -1.1), slab(-1.2, -0.7), slab(-1.1, -0.9));
      const pieces = await picture(atFacade);
      expect(pixelIndices(whole).filter((pixel) => differs(whole, pieces, pixel)).length).toBe(0);
      await page.evaluate(() => (headlessPage.world.background = new headlessPage.THREE.Color(0xff00ff)));
      await hide({ low: [-2e6, -2e6, -2e6], high: [5, 2e6, 2e6] }, { low: [-5, -2e6, -2e6], high: [2e6, 2e6, 2e6] });
      const nothing = await picture(atFacade);
      expect(pixelIndices(nothing).filter((pixel) => nothing[3 * pixel] < 250 || nothing[3 * pixel + 1] > 5).length).toBe(0);
    });

    it('is at the boxes in the contracted background block, too', async () => {
      const level = viewAt(tileset, [-1, -2.2, 0.3], [-1, -6, 0]); // away from the captured region
      await picture(level);
      const at = await page.evaluate(() => {
        for (let y = -0.9; y < 0; y += 0.05) {
          const place = headlessPage.surfaceAt(0, y);
          if (place && Math.hypot(...place) > 3) return { y, place };
        }
        return undefined;
      });
      expect(at).toBeDefined();
      const eye = [-1, -2.2, 0.3];
      const far = Math.hypot(...at!.place.map((x, a) => x - eye[a]));
      const boxAt = (share: number) => at!.place.map((x, a) => eye[a] + share * (x - eye[a]));
      const around = (middle: number[], half: number) => ({ low: middle.map((x) => x - half), high: middle.map((x) => x + half) });
      const distance = async () => {
        await picture(level);
        const place = await page.evaluate((y) => headlessPage.surfaceAt(0, y), at!.y);
        return place ? Math.hypot(...place.map((x, a) => x - eye[a])) : Infinity;
      };
      await hide(around(boxAt(0.3), 0.1 * far));
      expect(await distance() / far).toBeCloseTo(1, 1);
      await hide(around(boxAt(1), 0.3 * far));
      expect(await distance() / far).toBeGreaterThan(1.25);
    });

    it('is rejected if there are too many boxes', async () => {
      await hide(...Array.from({ length: 9 }, () => building));
      await expect(picture(atFacade)).rejects.toThrow('hidden: contains 9 boxes; at most 8 are supported; hide fewer, larger ones');
      await hide();
    });
  });

  describe('another scene beside it', () => {
    // Places the scenes one behind the other, along y.
    const kAway = 2.5;
    const away = (() => {
      const { rotation: r, scale } = tileset.worldFromScene;
      return [0, 1, 2].map((row) => scale * r[3 + row] * kAway);
    })();
    const front = viewAt(tileset, [-0.3, -3, 0.7], [-0.2, 1, 0]);
    const back = viewAt(tileset, [-0.3, kAway + 3, 0.7], [-0.2, kAway - 1, 0]);

    beforeAll(async () => {
      await open();
      await page.evaluate(async ([place, one]) => {
        await headlessPage.openBeside('scene/tileset.json', place, one);
        headlessPage.city!.showsBackgroundBlock = false;
      }, [away, options] as const);
    });
    afterAll(() => page.close());

    // Shows one scene, the other or both, in front of each background.
    async function pictures(view: View, city: boolean, beside: boolean): Promise<Uint8Array[]> {
      const images: Uint8Array[] = [];
      for (const colour of kBackgrounds) {
        await page.evaluate(([one, other, colour]) => {
          headlessPage.city!.visible = one;
          headlessPage.beside!.visible = other;
          headlessPage.world.background = new headlessPage.THREE.Color(colour);
        }, [city, beside, colour] as const);
        images.push(await picture(view));
      }
      return images;
    }

    async function check(view: View, isCityInFront: boolean): Promise<void> {
      const near = await pictures(view, isCityInFront, !isCityInFront);
      const far = await pictures(view, !isCityInFront, isCityInFront);
      const [both] = await pictures(view, true, true);
      const isOpaque = (images: Uint8Array[], pixel: number) => !differs(images[0], images[1], pixel, 0);
      const isClear = (images: Uint8Array[], pixel: number) => images[0][3 * pixel + 1] === 0 && images[1][3 * pixel] === 0 && images[0][3 * pixel] === 255;
      const hidden = pixelIndices(both).filter((pixel) => isOpaque(near, pixel) && !isClear(far, pixel));
      const open = pixelIndices(both).filter((pixel) => isClear(near, pixel) && isOpaque(far, pixel));
      expect(hidden.length).toBeGreaterThan(1500);
      expect(open.length).toBeGreaterThan(1500);
      expect(hidden.filter((pixel) => differs(both, near[0], pixel)).length / hidden.length).toBeLessThan(0.005);
      expect(open.filter((pixel) => differs(both, far[0], pixel)).length / open.length).toBeLessThan(0.005);
    }

    it('is occluded by the one in front, and visible beside it', async () => {
      await check(front, true);
      await check(back, false);
    });

    it('is occluded by opaque parts whichever of the two is drawn first', async () => {
      // Mirrors the bounds, so that the scenes are sorted in the opposite order.
      await page.evaluate(() => {
        for (const scene of [headlessPage.city!, headlessPage.beside!]) {
          Object.defineProperty(scene, 'bounds', { configurable: true, get: () => new headlessPage.THREE.Box3().setFromCenterAndSize(
            scene.position.clone().multiplyScalar(-1000), new headlessPage.THREE.Vector3(1, 1, 1)) });
        }
      });
      await check(front, true);
      await check(back, false);
      await page.evaluate(() => {
        for (const scene of [headlessPage.city!, headlessPage.beside!]) Reflect.deleteProperty(scene, 'bounds');
      });
    });

    it('has models in front of it occluded by the other one', async () => {
      const { pixels: before } = { pixels: (await pictures(front, true, true))[0] };
      // Behind the first building, in front of the second scene.
      await page.evaluate(() => headlessPage.addBox([-1.1, 0.8, 0], [-0.9, 0.9, 0.15]));
      const [after] = await pictures(front, true, true);
      const isRed = (pixel: number) => after[3 * pixel] > 235 && after[3 * pixel + 1] < 20;
      expect(pixelIndices(after).filter((pixel) => differs(before, after, pixel, 8) && !isRed(pixel)).length).toBeLessThan(60);
      await page.evaluate(() => headlessPage.removeBox());
    });
  });
});
