// Compares the browser's images of the golden scene with those of the CPU renderer.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenHash, goldenMesh, goldenScene, launch, missing, run, serve, type Server } from './machine';
import { cameraPath, decodePng, psnr } from './pictures';
import { openHeadlessPage } from './open-headless-page';
import { viewAt, type Place } from './views';

declare const headlessPage: HeadlessPage;

// Positions of the eye and the target in scene units: inside, above, outside, straight down.
const kLooks: [Place, Place][] = [
  [[-1.8, -0.9, 0.2], [0.5, 0.2, -0.6]],
  [[1.5, 0.9, 0.6], [-0.5, -0.3, -0.5]],
  [[0.1, -4, 2], [0, 0, -0.3]],
  [[-0.7, 0.1, 3], [-0.69, 0.12, 0]],
  [[6, 3, 0.5], [0, 0, 0]],
];

function gpuName(page: Page): Promise<string> {
  return page.evaluate(() => {
    const gl = document.createElement('canvas').getContext('webgl2')!;
    return String(gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info')!.UNMASKED_RENDERER_WEBGL));
  });
}

// Emulates GPUs with smaller 3D textures, for which the atlas is split into two.
function takeSmallTextures(): void {
  const { getParameter } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.getParameter = function (name: number) {
    return name === this.MAX_3D_TEXTURE_SIZE ? 32 : (getParameter.call(this, name) as unknown);
  };
}

// Emulates GPUs, for which scenes are drawn otherwise than by drivers for the CPU.
function claimGpu(): void {
  const { getParameter } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.getParameter = function (name: number) {
    const unmaskedRenderer = 0x9246;
    return name === unmaskedRenderer ? 'a GPU' : (getParameter.call(this, name) as unknown);
  };
}

// Emulates GPUs whose programs have few uniforms.
function takeFewUniforms(): void {
  const { getParameter } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.getParameter = function (name: number) {
    const unmaskedRenderer = 0x9246;
    if (name === unmaskedRenderer) return 'a GPU';
    return name === this.MAX_FRAGMENT_UNIFORM_VECTORS ? 64 : (getParameter.call(this, name) as unknown);
  };
}

// Emulates drivers that sample no textures in BC4 and BC5.
function takeNoBlockTextures(): void {
  const { getExtension } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.getExtension = function (this: WebGL2RenderingContext, name: 'OCULUS_multiview') {
    return String(name) === 'EXT_texture_compression_rgtc' ? null : getExtension.call(this, name);
  } as typeof getExtension;
}

const kEmulated: Record<string, (() => void) | undefined> = {
  small: takeSmallTextures, claimed: claimGpu, fewUniforms: takeFewUniforms, noBlockTextures: takeNoBlockTextures,
};

// Golden scenes; the first two represent the same landscape.
const kScenes = { volume: goldenScene, hash: goldenHash, mesh: goldenMesh };
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
    const [volume, hash, mesh] = await Promise.all([serve(goldenScene), serve(goldenHash), serve(goldenMesh)]);
    servers = { volume, hash, mesh };
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
    ['mesh', 'default', 0], ['mesh', 'default', 1], ['mesh', 'swiftshader', 0], ['mesh', 'claimed', 0],
    ['mesh', 'fewUniforms', 0], ['mesh', 'noBlockTextures', 0],
  ])('draws what the CPU draws of %s: GPU %s, level %i', async (representation, gpu, level) => {
    const name = `${representation}-${level}`;
    const path = join(folder, `path-${name}.json`);
    writeFileSync(path, cameraPath(tileset, views.map(({ matrix }) => matrix)));
    run('render', kScenes[representation], join(folder, name), '--path', path, '--lod', String(level));
    const said: string[] = [];
    const page = await openHeadlessPage(
      gpu === 'swiftshader' ? swiftShader : browser, servers[representation], said, kEmulated[gpu]);
    if (gpu === 'swiftshader') expect(await gpuName(page)).toContain('SwiftShader');
    await page.evaluate(
      (finestLevel) => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0, finestLevel } }), level);
    await page.evaluate(() => (headlessPage.city!.antialiases = false)); // the CPU shows the middle of pixels
    // SwiftShader is slow, and 64 frames of `mesh` are blended.
    const isFirst = gpu === 'default' && level === 0;
    const count = representation === 'mesh' ? (isFirst ? 2 : 1) : gpu === 'swiftshader' ? 2 : views.length;
    const looked = views.slice(0, count);
    for (const [i, view] of looked.entries()) {
      await page.evaluate((one) => headlessPage.settle(one), view);
      const pixels = new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
      const expected = await decodePng(page, join(folder, name, `0000${i}.png`));
      expect(new Set(expected).size).toBeGreaterThan(20); // something is visible
      expect(psnr(pixels, expected)).toBeGreaterThan(38);
    }
    expect(await page.evaluate(() => headlessPage.errors)).toEqual([]);
    expect(said).toEqual([]);
    // Browsers occasionally lose the WebGL context; everything must be restored.
    const before = await page.evaluate(() => headlessPage.pixels());
    await page.evaluate(() => headlessPage.loseGpu());
    await page.evaluate((view) => headlessPage.settle(view), looked[looked.length - 1]);
    expect(await page.evaluate(() => headlessPage.pixels())).toBe(before);
    await page.close();
  });

  it.each<Golden>(['volume', 'hash', 'mesh'])('fades distant parts beyond the captured region into the background: %s', async (representation) => {
    const said: string[] = [];
    const page = await openHeadlessPage(browser, servers[representation], said);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    await page.evaluate(() => (headlessPage.city!.framesAtRest = 8));
    const look = async (change: () => void) => {
      await page.evaluate(change);
      await page.evaluate((view) => headlessPage.settle(view), views[0]);
      return new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
    };
    const whole = await look(() => {});
    const faded = await look(() => (headlessPage.city!.visibility = 1e-3));
    const alone = await look(() => (headlessPage.city!.showsBackgroundBlock = false));
    // Filtered values between the scene and the background are neither brighter nor darker than both.
    const half = await look(() => {
      headlessPage.city!.showsBackgroundBlock = true;
      headlessPage.city!.visibility = 0.6;
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
