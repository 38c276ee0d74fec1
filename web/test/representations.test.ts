// Tests a world of three scenes, one of each representation, with ten models: they occlude one another correctly. By
// pixels.
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenHash, goldenMesh, goldenScene, launch, missing, serve, type Server } from './machine';
import { openHeadlessPage } from './open-headless-page';
import { viewAt } from './views';

declare const headlessPage: HeadlessPage;

const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
// Offsets of the scenes in the world, in metres; the golden scenes have the same frame.
const kScenes = [['volume', goldenScene, [0, 0, 0]], ['hash', goldenHash, [110, 20, 0]], ['mesh', goldenMesh, [-90, -20, 0]]] as const;

// In the golden scenes a building occupies |x + 1| < 0.4, |y| < 0.3, up to z = 0.45. Of the cubes of a scene, one is above
// its roof and two are below, all apart as seen from above.
const kCubes = [[-1.2, 0, 0.65], [-0.88, 0.12, 0.2], [-0.88, -0.12, -0.15]];
const kHalf = 2; // metres

function inWorld(place: readonly number[], away: readonly number[]): number[] {
  const { rotation: r, scale, translation } = tileset.worldFromScene;
  return [0, 1, 2].map((row) => translation[row] + away[row] + scale * (r[row] * place[0] + r[3 + row] * place[1] + r[6 + row] * place[2]));
}

describe.skipIf(missing())('a world of volume, hash and mesh', () => {
  let folder: string;
  let server: Server;
  let browser: Browser;
  let page: Page;
  const said: string[] = [];

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-representations-'));
    for (const [name, golden] of kScenes) cpSync(golden, join(folder, name), { recursive: true });
    writeFileSync(join(folder, 'world.json'), JSON.stringify({ kind: 'tessera world', version: 2, scenes: [{ url: 'volume' }] }));
    [server, browser] = await Promise.all([serve(folder), launch()]);
    page = await openHeadlessPage(browser, server, said);
    const options = { selection: { maximumScreenSpaceError: 0 } };
    await page.evaluate((one) => headlessPage.open('world/volume/tileset.json', one), options);
    for (const [name, , away] of kScenes.slice(1)) {
      await page.evaluate(([url, place, one]) => headlessPage.openBeside(url, [...place], one), [`world/${name}/tileset.json`, away, options] as const);
    }
    // The mean of 64 frames would take minutes without a GPU.
    await page.evaluate(() => {
      for (const scene of headlessPage.others) Object.assign(scene, { framesAtRest: 2, antialiases: false });
    });
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    rmSync(folder, { recursive: true });
    expect(said).toEqual([]);
  });

  async function picture(view: View): Promise<Uint8Array> {
    await page.evaluate((one) => headlessPage.settle(one), view);
    return new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
  }

  it('shows of ten models what is in front, and hides what is behind', async () => {
    const cubes = kScenes.flatMap(([, , away]) => kCubes.map((cube) => ({ middle: inWorld(cube, away), half: kHalf })));
    cubes.push({ middle: inWorld([-1.25, 0.25, 0.6], [0, 0, 0]), half: kHalf });
    for (const [name, , away] of kScenes) {
      const view = viewAt(tileset, [-1, -0.3, 3], [-1, 0, 0.4]);
      away.forEach((x, axis) => (view.matrix[12 + axis] += x));
      const without = await picture(view);
      await page.evaluate((all) => {
        headlessPage.addCubes(all);
        for (const scene of [headlessPage.city!, ...headlessPage.others]) scene.visible = false;
      }, cubes);
      const alone = await picture(view);
      await page.evaluate(() => {
        for (const scene of [headlessPage.city!, ...headlessPage.others]) scene.visible = true;
      });
      const together = await picture(view);
      await page.evaluate(() => headlessPage.removeBox());
      const counts = { above: 0, red: 0, below: 0, same: 0 };
      for (let pixel = 0; pixel < alone.length / 3; ++pixel) {
        const at = 3 * pixel;
        const right = (pixel % view.width) / view.width - 0.5;
        if (alone[at] < 250 || alone[at + 1] > 5 || Math.abs(right) > 0.25) continue; // cubes of other scenes are farther outside
        if (right < 0) {
          ++counts.above;
          if (together[at] > 235 && together[at + 1] < 20) ++counts.red;
        } else {
          ++counts.below;
          if ([0, 1, 2].every((c) => Math.abs(together[at + c] - without[at + c]) <= 8)) ++counts.same;
        }
      }
      expect(counts.above, name).toBeGreaterThan(200);
      expect(counts.below, name).toBeGreaterThan(200);
      expect(counts.red / counts.above, name).toBeGreaterThan(0.99);
      expect(counts.same / counts.below, name).toBeGreaterThan(0.99);
    }
  }, 180000);
});
