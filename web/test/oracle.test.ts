// The browser's pictures of the golden scene against those of the renderer on the processor.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain } from '../src/plain';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenHash, goldenScene, launch, missing, run, serve, type Server } from './machine';
import { cameraPath, decodePng, psnr } from './pictures';
import { openPlain } from './plain-page';
import { viewAt, type Place } from './views';

declare const plain: Plain;

// Places of the eye and what it looks at, scene units: inside, above, outside, straight down.
const kLooks: [Place, Place][] = [
  [[-1.8, -0.9, 0.2], [0.5, 0.2, -0.6]],
  [[1.5, 0.9, 0.6], [-0.5, -0.3, -0.5]],
  [[0.1, -4, 2], [0, 0, -0.3]],
  [[-0.7, 0.1, 3], [-0.69, 0.12, 0]],
  [[6, 3, 0.5], [0, 0, 0]],
];

function cardOf(page: Page): Promise<string> {
  return page.evaluate(() => {
    const gl = document.createElement('canvas').getContext('webgl2')!;
    return String(gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info')!.UNMASKED_RENDERER_WEBGL));
  });
}

// As on cards that take no larger textures of three dimensions: the atlas is cut into two.
function takeSmallTextures(): void {
  const { getParameter } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.getParameter = function (name: number) {
    return name === this.MAX_3D_TEXTURE_SIZE ? 32 : (getParameter.call(this, name) as unknown);
  };
}

// Two of the golden scenes, which stand for the same landscape.
const kScenes = { volume: goldenScene, hash: goldenHash };
type Golden = keyof typeof kScenes;

describe.skipIf(missing())('the browser', () => {
  let servers: Record<Golden, Server>;
  let browser: Browser;
  let swiftShader: Browser;
  let folder: string;
  const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
  const views = kLooks.map(([eye, target]) => viewAt(tileset, eye, target));

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-browser-'));
    const [volume, hash] = await Promise.all([serve(goldenScene), serve(goldenHash)]);
    servers = { volume, hash };
    [browser, swiftShader] = await Promise.all([launch(), launch('swiftshader')]);
  });
  afterAll(async () => {
    await Promise.all([browser?.close(), swiftShader?.close()]);
    for (const server of Object.values(servers ?? {})) server.close();
    rmSync(folder, { recursive: true });
  });

  it.each<[Golden, string, number]>([
    ['volume', 'default', 0], ['volume', 'default', 1], ['volume', 'swiftshader', 0], ['volume', 'small', 0],
    ['hash', 'default', 0], ['hash', 'default', 1], ['hash', 'swiftshader', 0],
  ])('draws what the processor draws of %s: %s card, level %i', async (representation, card, level) => {
    const name = `${representation}-${level}`;
    const path = join(folder, `path-${name}.json`);
    writeFileSync(path, cameraPath(tileset, views.map(({ matrix }) => matrix)));
    run('render', kScenes[representation], join(folder, name), '--path', path, '--lod', String(level));
    const said: string[] = [];
    const page = await openPlain(
      card === 'swiftshader' ? swiftShader : browser, servers[representation], said, card === 'small' ? takeSmallTextures : undefined);
    if (card === 'swiftshader') expect(await cardOf(page)).toContain('SwiftShader');
    await page.evaluate(
      (finestLevel) => plain.open('scene/tileset.json', { selection: { mostPixels: 0, finestLevel } }), level);
    const looked = card === 'swiftshader' ? views.slice(0, 2) : views; // it takes long
    for (const [i, view] of looked.entries()) {
      await page.evaluate((one) => plain.settle(one), view);
      const pixels = new Uint8Array(Buffer.from(await page.evaluate(() => plain.pixels()), 'base64'));
      const expected = await decodePng(page, join(folder, name, `0000${i}.png`));
      expect(new Set(expected).size).toBeGreaterThan(20); // something is to be seen
      expect(psnr(pixels, expected)).toBeGreaterThan(38);
    }
    expect(await page.evaluate(() => plain.errors)).toEqual([]);
    expect(said).toEqual([]);
    // Browsers take the card away now and then: all comes back.
    const before = await page.evaluate(() => plain.pixels());
    await page.evaluate(() => plain.loseCard());
    await page.evaluate((view) => plain.settle(view), looked[looked.length - 1]);
    expect(await page.evaluate(() => plain.pixels())).toBe(before);
    await page.close();
  });

  it.each<Golden>(['volume', 'hash'])('lets what lies far beyond what was captured fade into what is behind: %s', async (representation) => {
    const said: string[] = [];
    const page = await openPlain(browser, servers[representation], said);
    await page.evaluate(() => plain.open('scene/tileset.json', { selection: { mostPixels: 0 } }));
    const look = async (change: () => void) => {
      await page.evaluate(change);
      await page.evaluate((view) => plain.settle(view), views[0]);
      return new Uint8Array(Buffer.from(await page.evaluate(() => plain.pixels()), 'base64'));
    };
    const whole = await look(() => {});
    const faded = await look(() => (plain.city!.visibility = 1e-3));
    const alone = await look(() => (plain.city!.showsSurround = false));
    // Between what is there and what is behind, nothing is brighter or darker than both.
    const half = await look(() => {
      plain.city!.showsSurround = true;
      plain.city!.visibility = 0.6;
    });
    const between = half.filter((value, i) => value >= Math.min(whole[i], alone[i]) - 3 && value <= Math.max(whole[i], alone[i]) + 3);
    expect(between.length / half.length).toBeGreaterThan(0.99);
    const changed = (a: Uint8Array, b: Uint8Array) => a.filter((value, i) => Math.abs(value - b[i]) > 4).length / a.length;
    expect(changed(whole, alone)).toBeGreaterThan(0.1);
    expect(changed(faded, alone)).toBeLessThan(0.05);
    expect(Math.min(changed(half, alone), changed(half, whole))).toBeGreaterThan(0.05);
    expect(said).toEqual([]);
    await page.close();
  });
});
