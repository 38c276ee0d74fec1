// The viewer as people open it.
import { cpSync, mkdtempSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { goldenScene, launch, missing, serve } from './machine';

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

  // Opens a scene; what the page says is wrong, in its console, comes with it.
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

  it('shows the scene, and that it has come', async () => {
    await open(goldenScene, async (page, said) => {
      await page.waitForSelector('.loading.done', { state: 'attached' });
      expect(await page.title()).toBe('golden · tessera');
      expect(await page.isVisible('.error')).toBe(false);
      const picture = await page.screenshot();
      // A blank picture compresses to a few hundred bytes.
      expect(picture.length).toBeGreaterThan(20000);
      await page.keyboard.press('i');
      await page.waitForFunction(() => document.querySelector('.statistics')?.textContent?.includes('Graphics card'));
      expect(said).toEqual([]);
    });
  });

  it('says what is wrong with a tile that lies, and shows the rest', async () => {
    const scene = join(folder, 'lying');
    cpSync(goldenScene, scene, { recursive: true });
    const tiles = 'tiles/L0';
    const name = readdirSync(join(scene, tiles)).find((one) => !one.startsWith('surround'))!;
    writeFileSync(join(scene, tiles, name), 'no glTF at all');
    await open(scene, async (page) => {
      await page.waitForSelector('.error', { state: 'visible' });
      const text = await page.textContent('.error');
      expect(text).toContain(`${tiles}/${name}`);
      expect(text).toContain('Is no binary glTF 2.0 file.');
      expect(text).toContain('Copy the scene again, or bake it again.');
      const picture = await page.screenshot();
      expect(picture.length).toBeGreaterThan(20000);
    });
  });

  it('says what to do where there is no scene', async () => {
    await open(goldenScene, async (page) => {
      await page.goto(`${page.url()}?scene=nothing/tileset.json`);
      await page.waitForSelector('.error', { state: 'visible' });
      expect(await page.textContent('.error')).toContain('The server answered 404');
    });
  });
});
