// Tests features of `hash` scenes in the browser that `volume` scenes do not have.
import { cpSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import type { SceneOptions } from '../src/scene';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { countGpuMemory, type GpuMemory } from './gpu-memory';
import { goldenHash, launch, missing, run, serve, type Server } from './machine';
import { cameraPath, countColours, decodePng, isSame, psnr } from './pictures';
import { openHeadlessPage } from './open-headless-page';
import { viewAt } from './views';

declare const headlessPage: HeadlessPage;
declare const gpuMemory: GpuMemory;

// Changes the JSON of every content to text of the same length, and the names of the files, which state a digest.
function changeContents(folder: string, from: string, to: string): void {
  expect(to.length).toBe(from.length);
  const tilesetFile = join(folder, 'tileset.json');
  let tileset = readFileSync(tilesetFile, 'utf8');
  for (const entry of readdirSync(folder, { recursive: true, encoding: 'utf8' })) {
    if (!entry.endsWith('.glb')) continue;
    const file = readFileSync(join(folder, entry));
    const at = file.indexOf(from);
    expect(at).toBeGreaterThan(0);
    file.write(to, at);
    const changed = entry.replace(/-[0-9a-f]{16}\.glb$/, '_changed.glb');
    writeFileSync(join(folder, changed), file);
    tileset = tileset.replaceAll(entry, changed);
  }
  writeFileSync(tilesetFile, tileset);
}

describe.skipIf(missing())('a scene of hash', () => {
  let server: Server;
  let browser: Browser;
  let folder: string;
  const tileset = decodeTileset(readFileSync(`${goldenHash}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
  const across = viewAt(tileset, [0.1, -4, 2], [0, 0, -0.3]);
  const below = viewAt(tileset, [-0.7, 0.1, 0.5], [-0.69, 0.12, -1]);

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-hash-'));
    [server, browser] = await Promise.all([serve(goldenHash), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    rmSync(folder, { recursive: true });
  });

  async function open(said: string[], options: SceneOptions = {}, from = server): Promise<Page> {
    const page = await openHeadlessPage(browser, from, said);
    await page.evaluate((one) => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 }, ...one }), options);
    return page;
  }
  async function look(page: Page, view: View): Promise<Uint8Array> {
    await page.evaluate((one) => headlessPage.settle(one), view);
    return new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
  }

  it("that has a learned background shows the network's colour for rays that hit nothing", async () => {
    const scene = join(folder, 'whole');
    cpSync(goldenHash, scene, { recursive: true });
    changeContents(scene, '"learned_background":false', '"learned_background":true ');
    const up = viewAt(tileset, [0.2, 0.1, 0.4], [0.3, 0.4, 5]);
    const views = [across, up];
    writeFileSync(join(folder, 'path.json'), cameraPath(tileset, views.map(({ matrix }) => matrix)));
    run('render', scene, join(folder, 'oracle'), '--path', join(folder, 'path.json'));
    const whole = await serve(scene);
    const said: string[] = [];
    const page = await open(said, {}, whole);
    const ending = await open(said);
    for (const [i, view] of views.entries()) {
      const expected = await decodePng(page, join(folder, 'oracle', `0000${i}.png`));
      expect(psnr(await look(page, view), expected)).toBeGreaterThan(38);
      if (view === up) expect(psnr(await look(ending, view), expected)).toBeLessThan(30); // this omits the sky
    }
    // Opaque objects in the scene are behind the rays that it ends.
    const boxes = async () => {
      await page.evaluate(() => headlessPage.addBox([1, 1, 4.5], [2, 2, 5]));
      const pixels = await look(page, up);
      await page.evaluate(() => headlessPage.removeBox());
      return pixels.filter((_, at) => at % 3 === 0 && pixels[at] > 200 && pixels[at + 1] < 60 && pixels[at + 2] < 60).length;
    };
    expect(await boxes()).toBeGreaterThan(20);
    expect(said).toEqual([]);
    await page.close();
    await ending.close();
    whole.close();
  });

  it('that has a learned background does so without a background block, too, whatever is in view', async () => {
    const scene = join(folder, 'alone');
    cpSync(goldenHash, scene, { recursive: true });
    changeContents(scene, '"learned_background":false', '"learned_background":true ');
    const json = JSON.parse(readFileSync(join(scene, 'tileset.json'), 'utf8'));
    json.root.contents = json.root.contents.filter((one: any) => !one.extensions.TESSERA_scene.background_block);
    json.root.boundingVolume = json.root.contents[0].boundingVolume;
    writeFileSync(join(scene, 'tileset.json'), JSON.stringify(json));
    const views = [across, viewAt(tileset, [0.2, 0.1, 0.4], [0.3, 0.4, 5]), viewAt(tileset, [6, 3, 0.5], [20, 9, 3])];
    writeFileSync(join(folder, 'alone.json'), cameraPath(tileset, views.map(({ matrix }) => matrix)));
    run('render', scene, join(folder, 'aloneOracle'), '--path', join(folder, 'alone.json'));
    const served = await serve(scene);
    const said: string[] = [];
    const page = await open(said, {}, served);
    for (const [i, view] of views.entries()) {
      const expected = await decodePng(page, join(folder, 'aloneOracle', `0000${i}.png`));
      expect(new Set(expected).size).toBeGreaterThan(10);
      expect(psnr(await look(page, view), expected)).toBeGreaterThan(38);
    }
    expect(said).toEqual([]);
    await page.close();
    served.close();
  });

  it('shows the weights of its levels if they are the same everywhere', async () => {
    const said: string[] = [];
    // Level 1's block has these logits (attention for density and for all else), and its background block has no
    // weights.
    const uris = tileset.tiles.flatMap(({ contents }) => contents.map(({ uri }) => uri));
    const file = readFileSync(join(goldenHash, uris.find((uri) => uri.startsWith('tiles/L1/all'))!));
    const json = JSON.parse(file.toString('utf8', 20, 20 + file.readUInt32LE(12))) as { extensions: { TESSERA_content: { logits: number[] } } };
    const { logits } = json.extensions.TESSERA_content;
    const page = await open(said, { selection: { maximumScreenSpaceError: 0, finestLevel: 1 } });
    for (const [mode, level, logit] of [['densityAttention', 1, 0], ['attention', 1, 1], ['densityAttention', 2, 2], ['attention', 2, 3]] as const) {
      await page.evaluate(([display, featureLevel]) => Object.assign(headlessPage.city!, { display, featureLevel }), [mode, level] as const);
      const pixels = await look(page, below);
      const weight = 255 * (1 + Math.exp(-logits[logit])) ** (-1 / 2.2); // gamma-encoded
      const alike = pixels.filter((value) => Math.abs(value - weight) < 3).length / pixels.length;
      expect(alike, `${mode} ${level}`).toBeGreaterThan(0.9);
    }
    expect(await page.evaluate(() => headlessPage.city!.featureLevels)).toBe(2);
    expect(said).toEqual([]);
    await page.close();
  });

  it('shows the contribution of a single level, and distinguishes contents and levels of detail', async () => {
    const said: string[] = [];
    const page = await open(said);
    const show = async (display: string, featureLevel = 0) => {
      await page.evaluate((one) => Object.assign(headlessPage.city!, one), { display, featureLevel });
      return look(page, across);
    };
    const colour = await show('colour');
    const pictures = [
      colour, await show('contribution', 0), await show('contribution', 1), await show('contribution', 2), await show('diffuse'),
      await show('specular'), await show('features'), await show('blocks'), await show('levels'), await show('depth'),
    ];
    for (const [i, one] of pictures.entries()) {
      expect(new Set(one).size).toBeGreaterThan(20);
      for (const other of pictures.slice(i + 1)) expect(psnr(one, other)).toBeLessThan(35);
    }
    expect(isSame(await show('colour'), colour)).toBe(true);
    expect(said).toEqual([]);
    await page.close();
  });

  it('is shown by the viewer, whose settings offer its feature levels', async () => {
    const page = await browser.newPage({ viewport: { width: 480, height: 270 } });
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.goto(server.url);
    await page.waitForSelector('.loading.done', { state: 'attached' });
    expect(await countColours(page)).toBeGreaterThan(200);
    await page.keyboard.press('c');
    const level = page.getByLabel(/^Hash level/);
    expect(await level.isVisible()).toBe(false);
    await page.getByLabel(/^ShowColour/).selectOption('Colour of a hash level');
    expect(await level.isVisible()).toBe(true);
    const shown = () => level.evaluate((select: HTMLSelectElement) => [...select.options].filter(({ hidden }) => !hidden).length);
    expect(await shown()).toBe(3); // two fine levels, and the coarse features
    await level.selectOption('Level 2');
    await page.getByLabel(/^ShowColour/).selectOption('Attention to colour');
    expect(await shown()).toBe(2);
    expect(said).toEqual([]);
    await page.close();
  });

  it('reports its GPU memory correctly, and frees all of it', async () => {
    const page = await openHeadlessPage(browser, server, [], countGpuMemory);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    await page.evaluate((one) => headlessPage.settle(one), across);
    const memory = await page.evaluate(() => {
      const { gpuBytes, targetBytes } = headlessPage.city!.statistics!;
      const taken = gpuMemory.bytes;
      headlessPage.close();
      return { said: gpuBytes + targetBytes, taken, left: gpuMemory.bytes };
    });
    const counted = memory.taken - memory.left;
    expect(counted).toBeGreaterThan(1e6);
    expect(Math.abs(counted - memory.said) / counted).toBeLessThan(0.01);
    await page.close();
  });

  it('reports once that a GPU cannot blend half floats, and is complete', async () => {
    const page = await openHeadlessPage(browser, server, [], () => {
      const { getExtension } = WebGL2RenderingContext.prototype;
      WebGL2RenderingContext.prototype.getExtension = function (this: WebGL2RenderingContext, name: string) {
        return name.startsWith('EXT_color_buffer') ? null : (getExtension as (name: string) => unknown).call(this, name);
      } as typeof getExtension;
    });
    await page.evaluate(() => headlessPage.open('scene/tileset.json'));
    await page.evaluate((one) => headlessPage.settle(one), across);
    const said = await page.evaluate(() => headlessPage.errors);
    expect(said).toHaveLength(1);
    expect(said[0]).toContain('cannot blend half floats');
    await page.close();
  });

  it('is drawn on GPUs with fewer bits per pixel, too', async () => {
    const said: string[] = [];
    const scene = join(folder, 'bits');
    cpSync(goldenHash, scene, { recursive: true });
    const text = readFileSync(join(scene, 'tileset.json'), 'utf8');
    writeFileSync(join(scene, 'tileset.json'), text.replace('"levels": 2', '"levels": 5')); // needs one more target
    const deep = await serve(scene);
    const best = await open(said, {}, deep);
    const page = await openHeadlessPage(browser, deep, said, () => {
      const { checkFramebufferStatus } = WebGL2RenderingContext.prototype;
      WebGL2RenderingContext.prototype.checkFramebufferStatus = function (target) {
        let bits = 0;
        for (let n = 0; n < 8; ++n) {
          const of = (what: number) => this.getFramebufferAttachmentParameter(target, this.COLOR_ATTACHMENT0 + n, what) as number;
          if (of(this.FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) !== this.NONE) bits += 4 * of(this.FRAMEBUFFER_ATTACHMENT_RED_SIZE);
        }
        return bits > 256 ? this.FRAMEBUFFER_UNSUPPORTED : checkFramebufferStatus.call(this, target);
      };
    });
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
    expect(psnr(await look(page, across), await look(best, across))).toBeGreaterThan(50);
    const bytes = (one: Page) => one.evaluate(() => headlessPage.city!.statistics!.targetBytes);
    expect((await bytes(best)) - (await bytes(page))).toBeGreaterThanOrEqual((8 + 8) * across.width * across.height);
    expect(said).toEqual([]);
    await best.close();
    await page.close();
    deep.close();
  });

  it('is drawn the same whatever indices its networks have', async () => {
    const said: string[] = [];
    const scene = join(folder, 'levels');
    cpSync(goldenHash, scene, { recursive: true });
    const text = readFileSync(join(scene, 'tileset.json'), 'utf8');
    expect(text).toContain('"levels": 2');
    writeFileSync(join(scene, 'tileset.json'), text.replace('"levels": 2', '"levels": 5'));
    const deep = await serve(scene);
    const [page, plainly] = [await open(said, {}, deep), await open(said)];
    const expected = await look(plainly, across);
    expect(isSame(await look(page, across), expected)).toBe(true);
    // As if two other contents came first: their networks take the indices that one weight target distinguishes.
    await page.evaluate(() => {
      const { drawer: { marching } } = headlessPage.city as unknown as { drawer: { marching: any } };
      const { assignNetworks } = marching;
      marching.assignNetworks = (contents: any[]) => {
        const { networks, behind, hasLearnedBackground } = assignNetworks.call(marching, contents);
        for (const { uniforms } of contents) uniforms.network.value += 3;
        return { networks: [networks[0], networks[0], networks[0], ...networks], behind: behind + 3, hasLearnedBackground };
      };
    });
    expect(psnr(await look(page, across), expected)).toBeGreaterThan(55);
    expect(said).toEqual([]);
    await page.close();
    await plainly.close();
    deep.close();
  });
});
