// Tests ordinary models in the scene: model and scene occlude each other correctly. By pixels.
import { readFileSync } from 'node:fs';
import type { Browser, Page } from 'playwright-core';
import type { Material, Mesh } from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenScene, launch, missing, serve, type Server } from './machine';
import { openHeadlessPage } from './open-headless-page';
import { viewAt, type Place } from './views';

declare const headlessPage: HeadlessPage;

// In the golden scene a building occupies |x + 1| < 0.4, |y| < 0.3, up to z = 0.45.
const kRoof = 0.45;
const kFacade = -0.3;

describe.skipIf(missing())('a model in the scene', () => {
  let server: Server;
  let browser: Browser;
  let page: Page;
  const said: string[] = [];
  const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
  const atFacade = viewAt(tileset, [-1, -2.2, 0.3], [-1, 0, 0.1]);

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
    page = await openHeadlessPage(browser, server, said);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    expect(said).toEqual([]);
  });

  async function picture(view: View): Promise<Uint8Array> {
    await page.evaluate((one) => headlessPage.settle(one), view);
    return new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
  }

  // Returns, of the pixels that a box covers, how many have its colour, and how many are the same as without it.
  // `change` modifies the box before it is drawn with the scene.
  async function draw(
    view: View, low: Place, high: Place, change: (box: Mesh) => void = () => {},
  ): Promise<{ covered: number; red: number; same: number }> {
    const without = await picture(view);
    await page.evaluate(([from, to]) => {
      headlessPage.addBox([...from], [...to]);
      headlessPage.city!.visible = false;
    }, [low, high] as const);
    const alone = await picture(view);
    await page.evaluate((done) => {
      headlessPage.city!.visible = true;
      const box = headlessPage.world.getObjectByName('box');
      (new Function('box', `(${done})(box)`) as (box: unknown) => void)(box);
    }, change.toString());
    const together = await picture(view);
    await page.evaluate(() => headlessPage.removeBox());
    const counts = { covered: 0, red: 0, same: 0 };
    for (let at = 0; at < alone.length; at += 3) {
      if (alone[at] < 250 || alone[at + 1] > 5) continue;
      ++counts.covered;
      if (together[at] > 235 && together[at + 1] < 20) ++counts.red;
      if ([0, 1, 2].every((c) => Math.abs(together[at + c] - without[at + c]) <= 8)) ++counts.same;
    }
    expect(counts.covered).toBeGreaterThan(500);
    return counts;
  }

  it('hides the facade that it stands in front of', async () => {
    const { covered, red } = await draw(atFacade, [-1.15, kFacade - 0.4, 0], [-0.85, kFacade - 0.2, 0.3]);
    expect(red / covered).toBeGreaterThan(0.99);
  });

  it('is hidden by the facade that it stands behind, in the building or beyond it', async () => {
    for (const y of [-0.1, 0.5]) {
      const { covered, same } = await draw(atFacade, [-1.15, y, -0.1], [-0.85, y + 0.15, 0.2]);
      expect(same / covered).toBeGreaterThan(0.99);
    }
  });

  it('is visible where it rises above the roof', async () => {
    const level = viewAt(tileset, [-1, -2.2, kRoof + 0.001], [-1, 0, kRoof + 0.001]);
    const { covered, red, same } = await draw(level, [-1.15, 0.5, kRoof - 0.2], [-0.85, 0.6, kRoof + 0.2]);
    expect(red / covered).toBeGreaterThan(0.42);
    expect(red / covered).toBeLessThan(0.52);
    expect(same / covered).toBeGreaterThan(0.33); // the roof's edge in between is soft by a voxel, which is a sixth of the height
  });

  it('is drawn where there is nothing of the scene behind it', async () => {
    const up = viewAt(tileset, [-1, -2.2, 0.3], [-1, 0, 3]);
    const { covered, red } = await draw(up, [-1.3, -0.3, 1.9], [-0.7, -0.2, 2.5]);
    expect(red / covered).toBeGreaterThan(0.99);
  });

  it('occludes correctly as a child of the scene, too', async () => {
    const join = (box: Mesh) => void headlessPage.city!.attach(box);
    const before = await draw(atFacade, [-1.15, kFacade - 0.4, 0], [-0.85, kFacade - 0.2, 0.3], join);
    expect(before.red / before.covered).toBeGreaterThan(0.99);
    const behind = await draw(atFacade, [-1.15, -0.1, -0.1], [-0.85, 0.05, 0.2], join);
    expect(behind.same / behind.covered).toBeGreaterThan(0.99);
  });

  it('occludes with the opaque one of its materials', async () => {
    const { covered, red } = await draw(atFacade, [-1.15, kFacade - 0.4, 0], [-0.85, kFacade - 0.2, 0.3], (box) => {
      const opaque = box.material as Material;
      const glass = opaque.clone();
      glass.transparent = true;
      box.material = [glass, opaque, glass, opaque, glass, opaque]; // materials of the six sides, of which the fourth is visible
    });
    expect(red / covered).toBeGreaterThan(0.99);
  });

  it('occludes nothing while its parent is invisible', async () => {
    const { covered, same } = await draw(atFacade, [-1.15, kFacade - 0.4, 0], [-0.85, kFacade - 0.2, 0.3], (box) => {
      const holder = new headlessPage.THREE.Group();
      holder.visible = false;
      headlessPage.world.add(holder);
      holder.attach(box);
    });
    expect(same / covered).toBeGreaterThan(0.99);
  });
});
