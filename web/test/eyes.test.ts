// Tests several cameras side by side, such as the two eyes of a headset: each renders what it renders alone. By pixels.
import { readFileSync } from 'node:fs';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenHash, goldenScene, launch, missing, serve, type Server } from './machine';
import { psnr } from './pictures';
import { openHeadlessPage } from './open-headless-page';
import { viewAt, type Place } from './views';

declare const headlessPage: HeadlessPage;

// In the golden scenes a building occupies |x + 1| < 0.4, |y| < 0.3, and blocks meet at x = 0.
describe.skipIf(missing()).each([['volume', goldenScene], ['hash', goldenHash]])('two cameras, in a scene of %s,', (_, golden) => {
  let server: Server;
  let browser: Browser;
  let page: Page;
  const said: string[] = [];
  const tileset = decodeTileset(readFileSync(`${golden}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
  // Off-centre.
  const view = (eye: Place, target: Place): View => ({ ...viewAt(tileset, eye, target), cx: 126, width: 240, cy: 80, height: 160 });
  const atFacade = [view([-1.05, -2.2, 0.3], [-1, 0, 0.1]), view([-0.95, -2.2, 0.3], [-1, 0, 0.1])];

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(golden), launch()]);
    page = await openHeadlessPage(browser, server, said);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    expect(said).toEqual([]);
  });

  async function picture(views: View | View[]): Promise<Uint8Array> {
    await page.evaluate((some) => headlessPage.settle(some), views);
    return new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
  }

  // Returns the image of each camera when all are rendered together, and when it is rendered alone.
  async function pairs(views: View[]): Promise<[Uint8Array, Uint8Array][]> {
    const together = await picture(views);
    const row = 3 * views.reduce((sum, { width }) => sum + width, 0);
    const results: [Uint8Array, Uint8Array][] = [];
    let left = 0;
    for (const one of views) {
      const part = new Uint8Array(3 * one.width * one.height);
      for (let y = 0; y < one.height; ++y) part.set(together.subarray(y * row + left, y * row + left + 3 * one.width), 3 * one.width * y);
      left += 3 * one.width;
      results.push([part, await picture(one)]);
    }
    return results;
  }

  it.each<[string, View[]]>([
    ['an eye’s width apart', atFacade],
    ['on two sides of a wall between blocks', [view([-0.03, -1.5, 0.6], [0.2, 0, 0]), view([0.03, -1.5, 0.6], [0.2, 0, 0])]],
    ['that look away from one another', [view([-1.8, -0.9, 0.2], [0.5, 0.2, -0.6]), view([1.5, 0.9, 0.6], [3, 2, 0.3])]],
  ])('render what each renders alone: %s', async (_, views) => {
    for (const [together, alone] of await pairs(views)) {
      expect(new Set(alone).size).toBeGreaterThan(20); // something is visible
      expect(psnr(together, alone)).toBeGreaterThan(60);
    }
  });

  it('render the same at lower resolution, without bleeding into each other', async () => {
    await page.evaluate(() => (headlessPage.city!.resolutionScale = 0.25));
    for (const [together, alone] of await pairs(atFacade)) expect(psnr(together, alone)).toBeGreaterThan(60);
    await page.evaluate(() => (headlessPage.city!.resolutionScale = 1));
  });

  it.each<[string, number, number, number]>([
    ['hide what is behind a model', -0.7, 0.99, 1], ['have a model hidden behind a facade', -0.1, 0, 0.01],
  ])('%s', async (_, y, minimum, maximum) => {
    await page.evaluate((at) => headlessPage.addBox([-1.15, at, 0], [-0.85, at + 0.1, 0.2]), y);
    const red = (pixels: Uint8Array) => pixels.filter((value, at) => at % 3 === 0 && value > 235 && pixels[at + 1] < 20).length;
    const drawn = await pairs(atFacade);
    await page.evaluate(() => (headlessPage.city!.visible = false));
    const modelsAlone = await pairs(atFacade);
    await page.evaluate(() => {
      headlessPage.city!.visible = true;
      headlessPage.removeBox();
    });
    drawn.forEach(([together, alone], i) => {
      expect(psnr(together, alone)).toBeGreaterThan(60);
      const covered = red(modelsAlone[i][1]);
      expect(covered).toBeGreaterThan(500);
      expect(red(together) / covered).toBeGreaterThanOrEqual(minimum);
      expect(red(together) / covered).toBeLessThanOrEqual(maximum);
    });
  });

  it('pick the same place under their pixels', async () => {
    const pick = (eye: number) => page.evaluate(
      (one) => headlessPage.city!.pick(new headlessPage.THREE.Vector2(0.1, -0.2), headlessPage.renderer, one)!.toArray(), eye);
    await picture(atFacade);
    const together = [await pick(0), await pick(1)];
    for (const [i, one] of atFacade.entries()) {
      await picture(one);
      const alone = await pick(0);
      alone.forEach((x, axis) => expect(together[i][axis]).toBeCloseTo(x, 4));
    }
    expect(together[0]).not.toEqual(together[1]);
  });

  it('count their render targets in the budget', async () => {
    const bytes = async (views: View | View[]) => {
      await picture(views);
      return page.evaluate(() => headlessPage.city!.statistics!.targetBytes);
    };
    const ofOne = await bytes(atFacade[0]);
    expect(Math.abs((await bytes(atFacade)) / ofOne - 2)).toBeLessThan(0.001); // what they need besides is small
  });
});
