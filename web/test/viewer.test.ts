// Tests the viewer in typical use.
import { cpSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenScene, launch, missing, run, serve } from './machine';
import { countColours, decodePng, psnr } from './pictures';

describe.skipIf(missing())('the viewer', () => {
  let browser: Browser;
  let folder: string;

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-viewer-'));
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
    rmSync(folder, { recursive: true });
  });

  // Opens a scene; also returns the errors in the page's console.
  async function open(scene: string, visit: (page: Page, said: string[]) => Promise<void>): Promise<void> {
    const server = await serve(scene);
    const page = await browser.newPage({ viewport: { width: 480, height: 270 } });
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    try {
      await page.goto(server.url);
      await visit(page, said);
    } finally {
      await page.close();
      server.close();
    }
  }

  it('shows the scene, and that it has loaded', async () => {
    await open(goldenScene, async (page, said) => {
      await page.waitForSelector('.loading.done', { state: 'attached' });
      expect(await page.title()).toBe('golden · tessera');
      expect(await page.isVisible('.error')).toBe(false);
      expect(await countColours(page)).toBeGreaterThan(200);
      await page.keyboard.press('i');
      await page.waitForFunction(() => document.querySelector('.statistics')?.textContent?.includes('GPU'));
      const frame = page.locator('.statistics dd').first();
      await expect.poll(() => frame.textContent()).toBe('at rest');
      await page.keyboard.down('w');
      await expect.poll(() => frame.textContent()).toMatch(/^[\d.]+ ms, [\d.]+ fps$/);
      await page.keyboard.up('w');
      await expect.poll(() => frame.textContent(), { timeout: 20000 }).toBe('at rest');
      expect(said).toEqual([]);
    });
  });

  it('shares a view by its address, and renders it at any size and along a path as the CPU does', async () => {
    const tileset = decodeTileset(readFileSync(join(goldenScene, 'tileset.json'), 'utf8'), 'tileset.json', kCodecs);
    await open(goldenScene, async (page, said) => {
      // Above the left block, looking towards the other one; in the capture's world.
      const places = [[-1.8, -1.6, 0.9], [0.8, 0.2, -0.4]].map(([x, y, z]) => {
        const { rotation: r, scale, translation: t } = tileset.worldFromScene;
        return [0, 1, 2].map((row) => scale * (r[row] * x + r[3 + row] * y + r[6 + row] * z) + t[row]).join(',');
      });
      const address = `${page.url()}#eye=${places[0]}&target=${places[1]}&fov=60`;
      await page.goto('about:blank');
      await page.goto(address);
      await page.waitForSelector('.loading.done', { state: 'attached' });
      const saved = async (click: string) => {
        const [file] = await Promise.all([page.waitForEvent('download'), page.click(`text=${click}`)]);
        const path = join(folder, file.suggestedFilename());
        await file.saveAs(path);
        return path;
      };
      await page.keyboard.press('c');
      await page.getByLabel('Outside the captured region').selectOption('Is shown in full');
      await page.keyboard.press('b');
      await page.click('text=Keep this view');
      await page.keyboard.press('w', { delay: 300 });
      await page.click('text=Keep this view');
      const cameraPath = JSON.parse(readFileSync(await saved('Save camera path'), 'utf8')) as { camera_path: unknown[]; fps: number };
      expect(cameraPath.camera_path).toHaveLength(91);
      await page.click('text=View 1');
      await page.waitForTimeout(1500);
      expect(new URL(page.url()).hash).toContain('eye=');
      await page.keyboard.press('p');
      await page.fill('[aria-label=Width]', '1200');
      await page.fill('[aria-label=Height]', '300');
      const picture = await decodePng(page, await saved('Save image'));
      const path = join(folder, 'path.json');
      writeFileSync(path, JSON.stringify({
        ...cameraPath, render_width: 1200, render_height: 300, fps: 1, seconds: 1,
        camera_path: [{ ...(cameraPath.camera_path[0] as object), aspect: 4 }],
      }));
      run('render', goldenScene, join(folder, 'oracle'), '--path', path);
      expect(psnr(picture, await decodePng(page, join(folder, 'oracle', '00000.png')))).toBeGreaterThan(38);
      expect(said).toEqual([]);
    });
  });

  it('shows the progress of a large screenshot over the previous image, and can cancel it', async () => {
    await open(goldenScene, async (page, said) => {
      await page.waitForSelector('.loading.done', { state: 'attached' });
      await page.keyboard.press('p');
      await page.waitForTimeout(1500);
      const besidePanel = () => page.screenshot({ clip: { x: 380, y: 20, width: 95, height: 230 } });
      const before = await besidePanel();
      await page.fill('[aria-label=Width]', '4000');
      await page.fill('[aria-label=Height]', '2000');
      await page.click('text=Save image');
      await page.waitForSelector('text=/Part [2-9] of 32/');
      expect(before.equals(await besidePanel())).toBe(true);
      expect(await page.locator('.toolbar').evaluate(({ inert }: HTMLElement) => inert)).toBe(true);
      await page.click('text=Cancel');
      await page.waitForSelector('text=Save image', { state: 'visible' });
      await page.waitForSelector('.still', { state: 'detached' });
      expect(await page.locator('.toolbar').evaluate(({ inert }: HTMLElement) => inert)).toBe(false);
      expect(await page.isVisible('.error')).toBe(false);
      await page.waitForTimeout(1500);
      expect(before.equals(await besidePanel())).toBe(true);
      expect(said).toEqual([]);
    });
  });

  it('keeps a view that looks upwards, and the navigation mode', async () => {
    await open(goldenScene, async (page, said) => {
      const hash = '#eye=10,-60,4&target=10,-20,19&fov=60&mode=fly';
      const address = page.url();
      for (const [given, expected] of [[hash, hash], [hash.replace('fly', 'map'), hash.replace('fly', 'orbit')]]) {
        await page.goto('about:blank');
        await page.goto(`${address}${given}`);
        await page.waitForSelector('.loading.done', { state: 'attached' });
        await page.keyboard.press('i'); // changes the image
        await page.waitForTimeout(1200);
        expect(new URL(page.url()).hash).toBe(expected);
      }
      expect(said).toEqual([]);
    });
  });

  it('recovers from a lost WebGL context, with half of the memory', async () => {
    await open(goldenScene, async (page, said) => {
      await page.waitForSelector('.loading.done', { state: 'attached' });
      const before = await countColours(page);
      expect(before).toBeGreaterThan(200);
      await page.evaluate(async () => {
        const canvas = document.querySelector<HTMLCanvasElement>('#view')!;
        const extension = canvas.getContext('webgl2')!.getExtension('WEBGL_lose_context')!;
        const restored = new Promise((resolve) => canvas.addEventListener('webglcontextrestored', resolve, { once: true }));
        canvas.addEventListener('webglcontextlost', () => setTimeout(() => extension.restoreContext(), 100), { once: true });
        extension.loseContext();
        await restored;
      });
      await expect.poll(() => countColours(page), { timeout: 20000 }).toBeGreaterThan(0.9 * before);
      await page.keyboard.press('c');
      const memory = page.locator('label', { hasText: 'Graphics memory' }).locator('output');
      expect(await memory.textContent()).toBe('256 MiB');
      expect(said).toEqual([]);
    });
  });

  it('reports a malformed tile, and shows the rest', async () => {
    const scene = join(folder, 'lying');
    cpSync(goldenScene, scene, { recursive: true });
    const tiles = 'tiles/L0';
    const name = readdirSync(join(scene, tiles)).find((one) => !one.startsWith('background_block'))!;
    writeFileSync(join(scene, tiles, name), 'no glTF at all');
    await open(scene, async (page) => {
      await page.waitForSelector('.error', { state: 'visible' });
      const text = await page.textContent('.error');
      expect(text).toContain(`${tiles}/${name}`);
      expect(text).toContain('Is not a binary glTF 2.0 file, or is cut short.');
      expect(text).toContain('Copy the scene again, or bake it again.');
      expect(await countColours(page)).toBeGreaterThan(200);
    });
  });

  it('explains what to do if there is no scene', async () => {
    await open(goldenScene, async (page) => {
      await page.goto(`${page.url()}?scene=nothing/tileset.json`);
      await page.waitForSelector('.error', { state: 'visible' });
      expect(await page.textContent('.error')).toContain('The server answered 404');
    });
  });
});
