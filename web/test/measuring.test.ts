// Tests the measuring tool by user interaction on the golden scene, whose heights are known
// (tests/golden/golden_landscape.cpp).
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import * as THREE from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import type { Vec3 } from '../src/tiles/tileset';
import { goldenScene, launch, missing, serve } from './machine';

const kSize = { width: 1200, height: 250 }; // the panel covers no clicked place
const tileset = decodeTileset(readFileSync(join(goldenScene, 'tileset.json'), 'utf8'), 'tileset.json', kCodecs);
const metres = tileset.worldFromScene.scale; // per scene unit
const kVoxel = metres / 16;

// base/random.h and the noise of the golden scene, which define the ground.
const mask = (1n << 64n) - 1n;
function mix64(value: bigint): bigint {
  let x = (value + 0x9e3779b97f4a7c15n) & mask;
  x = ((x ^ (x >> 30n)) * 0xbf58476d1ce4e5b9n) & mask;
  x = ((x ^ (x >> 27n)) * 0x94d049bb133111ebn) & mask;
  return x ^ (x >> 31n);
}
const key = mix64(mix64(2024n) ^ 0xd1342543de82ef95n);

function groundAt(sceneX: number, sceneY: number): number {
  const [x, y] = [1.5 * sceneX, 1.5 * sceneY];
  const [i, j] = [Math.floor(x), Math.floor(y)];
  const smooth = (t: number) => t * t * (3 - 2 * t);
  const at = (a: number, b: number) => {
    const bits = mix64(key ^ ((BigInt((a + 4096) * 8192 + b + 4096) * 0x2545f4914f6cdd1dn) & mask));
    return 2 * Number(bits >> 11n) * 2 ** -53 - 1;
  };
  const [u, v] = [smooth(x - i), smooth(y - j)];
  const noise = (1 - v) * ((1 - u) * at(i, j) + u * at(i + 1, j)) + v * ((1 - u) * at(i, j + 1) + u * at(i + 1, j + 1));
  return -0.45 + 0.12 * noise;
}

const { rotation: r, scale: s, translation: t } = tileset.worldFromScene;
const viewerFromScene = new THREE.Matrix4()
  .set(r[0] * s, r[3] * s, r[6] * s, t[0], r[1] * s, r[4] * s, r[7] * s, t[1], r[2] * s, r[5] * s, r[8] * s, t[2], 0, 0, 0, 1)
  .premultiply(new THREE.Matrix4().set(1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1)); // y up, from z up

// Returns where a place of the scene is in the first view (Navigation.showAll).
function projectToPixel(inScene: Vec3): { x: number; y: number } {
  const { low, high } = tileset.box;
  const bounds = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high)).applyMatrix4(viewerFromScene);
  const size = bounds.getSize(new THREE.Vector3());
  const target = bounds.getCenter(new THREE.Vector3()).setY(bounds.min.y);
  const camera = new THREE.PerspectiveCamera(50, kSize.width / kSize.height);
  camera.position.set(0, 0.75, 0.8).multiplyScalar(0.5 * Math.hypot(size.x, size.z)).add(target);
  camera.lookAt(target);
  camera.updateMatrixWorld();
  const { x, y } = new THREE.Vector3(...inScene).applyMatrix4(viewerFromScene).project(camera);
  return { x: (0.5 + 0.5 * x) * kSize.width, y: (0.5 - 0.5 * y) * kSize.height };
}

const kHighRoof: Vec3 = [-1, 0, 0.45];
const kLowRoof: Vec3 = [1, 0, 0.1];
const kGround: Vec3 = [0, -0.6, groundAt(0, -0.6)];

describe.skipIf(missing())('measuring', { timeout: 120000 }, () => {
  let browser: Browser;
  let folder: string;

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-measuring-'));
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
    rmSync(folder, { recursive: true });
  });

  async function open(scene: string, visit: (page: Page) => Promise<void>): Promise<void> {
    const server = await serve(scene);
    const page = await browser.newPage({ viewport: kSize });
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    try {
      await page.goto(server.url);
      await page.waitForSelector('.loading.done', { state: 'attached', timeout: 60000 });
      await page.keyboard.press('m');
      await visit(page);
      expect(said).toEqual([]);
    } finally {
      await page.close();
      server.close();
    }
  }

  async function click(page: Page, place: Vec3): Promise<void> {
    const { x, y } = projectToPixel(place);
    await page.mouse.click(x, y);
    await page.waitForTimeout(450); // separate clicks, not a double click
  }

  async function figures(page: Page): Promise<Record<string, string>> {
    const [names, values] = await Promise.all(['dt', 'dd'].map((tag) => page.locator(`.measure .figures ${tag}`).allTextContents()));
    return Object.fromEntries(names.map((name, i) => [name, values[i]]));
  }

  it('finds heights within a voxel', async () => {
    await open(goldenScene, async (page) => {
      const measureHeight = async (low: Vec3, high: Vec3) => {
        await page.click('.measure .choice >> text=Height');
        await click(page, low);
        await click(page, high);
        const { Height: height, Horizontal: horizontal } = await figures(page);
        expect(height).toMatch(/^\d+\.\d\d m$/);
        const apart = metres * Math.hypot(high[0] - low[0], high[1] - low[1]);
        expect(Math.abs(parseFloat(horizontal) - apart)).toBeLessThan(2 * kVoxel);
        return parseFloat(height);
      };
      expect(Math.abs((await measureHeight(kLowRoof, kHighRoof)) - 0.35 * metres)).toBeLessThan(kVoxel);
      expect(Math.abs((await measureHeight(kGround, kHighRoof)) - (0.45 - kGround[2]) * metres)).toBeLessThan(kVoxel);
      // Height above the ellipsoid: the altitude of the georeference plus the height of the roof in the capture. The
      // visible surface is somewhat below the roof, as roofs are soft.
      const place = await page.locator('.measure .part dd').allTextContents();
      expect(Math.abs(parseFloat(place[2]) - (12 + 5 + 0.45 * metres))).toBeLessThan(1.5 * kVoxel);
      expect(parseFloat(place[0])).toBeCloseTo(50.8225, 2);
      expect(parseFloat(place[1])).toBeCloseTo(-0.1372, 2);
      expect(await page.locator('.measure li').count()).toBe(2);
    });
  });

  it('ends with a double click, which does not navigate', async () => {
    await open(goldenScene, async (page) => {
      await click(page, kLowRoof);
      const { x, y } = projectToPixel(kHighRoof);
      await page.mouse.dblclick(x, y);
      await page.locator('.measure li').waitFor();
      const label = page.locator('.measure-labels span:not([hidden])');
      expect(await label.count()).toBe(1); // one segment
      const style = await label.getAttribute('style');
      await page.waitForTimeout(900); // longer than a flight
      expect(await label.getAttribute('style')).toBe(style);
      // Finished measurements reappear with the tool, until they are deleted.
      await page.keyboard.press('Escape');
      expect(await page.isVisible('.measure')).toBe(false);
      expect(await label.isVisible()).toBe(false);
      await page.mouse.dblclick(x, y);
      await page.waitForTimeout(900);
      await page.keyboard.press('m');
      await label.waitFor();
      await page.waitForTimeout(300);
      expect(await label.getAttribute('style')).not.toBe(style); // without the tool a double click moves the camera
      await page.click('.measure li [aria-label^=Delete]');
      expect(await label.count()).toBe(0);
    });
  });

  it('undoes places, ends with Enter, and exports finished measurements as GeoJSON', async () => {
    await open(goldenScene, async (page) => {
      await page.click('.measure .choice >> text=Area');
      const roof = ([[0.75, -0.15], [1.25, -0.15], [1.25, 0.15], [0.75, 0.15]] as const).map(([x, y]): Vec3 => [x, y, 0.1]);
      await click(page, roof[0]);
      await click(page, roof[1]);
      await click(page, kHighRoof);
      expect(Object.keys(await figures(page))).toEqual(['In plan', 'On its plane', 'Perimeter']);
      await page.keyboard.press('Backspace');
      await click(page, roof[2]);
      await click(page, roof[3]);
      await page.keyboard.press('Enter');
      const expected = 0.5 * 0.3 * metres ** 2;
      expect(Math.abs(parseFloat((await figures(page))['In plan']) - expected)).toBeLessThan(0.15 * expected);
      const [download] = await Promise.all([page.waitForEvent('download'), page.click('text=Download')]);
      expect(download.suggestedFilename()).toBe('golden-measurements.geojson');
      const { features } = JSON.parse(readFileSync(await download.path(), 'utf8'));
      expect(features).toHaveLength(1);
      expect(features[0].geometry.type).toBe('Polygon');
      expect(features[0].geometry.coordinates[0]).toHaveLength(5);
      expect(features[0].properties.areaInPlan).toBeCloseTo(parseFloat((await figures(page))['In plan']), 0);
    });
  });

  it('uses no metres if the capture has no scale', async () => {
    const scene = join(folder, 'nowhere');
    cpSync(goldenScene, scene, { recursive: true });
    const written = JSON.parse(readFileSync(join(scene, 'tileset.json'), 'utf8'));
    delete written.root.transform;
    delete written.extensions.TESSERA_scene.georeference;
    writeFileSync(join(scene, 'tileset.json'), JSON.stringify(written));
    await open(scene, async (page) => {
      await click(page, kLowRoof);
      await click(page, kHighRoof);
      expect((await figures(page)).Length).toMatch(/^[\d.]+ units$/);
      expect(await page.textContent('.measure')).toContain('no scale');
      expect(await page.textContent('.measure')).not.toContain('Latitude');
    });
  });
});
