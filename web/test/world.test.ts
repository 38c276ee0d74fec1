// Tests a world that `tessera serve` provides, and what users add to it. By pixels.
import { spawnSync } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import { testGlb } from '../src/testing/test-glb';
import { goldenScene, launch, missing, program, serve, viewer, type Server } from './machine';
import { decodePixels, pictureAtRest } from './pictures';

const kView = 'eye=10,-120,70&target=10,-20,5&fov=50';
const upright = [0, 0, 0, 1];
const world = {
  kind: 'tessera world', version: 2,
  scenes: [
    { name: 'Old town', url: 'towns/old.scene', position: [90, 20, 0], rotation: upright, scale: 1, visible: true },
    { name: 'golden', url: 'golden.scene/tileset.json', visible: true },
  ],
  models: ['a/cube.glb', 'b c/cube.glb'].map((file, i) => ({
    name: 'cube', files: [file], position: [10 - 20 * i, -45, 8], rotation: upright, scale: [1, 1, 1], visible: true, plays: i === 0,
  })),
  hidden: [{ name: 'Part 1', middle: [-5, -35, 8], size: [12, 12, 12], turn: 0.5, hides: true }],
  bookmarks: [{ name: 'From the south', view: kView }],
};

describe.skipIf(missing())('a served world', () => {
  let folder: string;
  let server: Server;
  let browser: Browser;
  let page: Page;
  let said: string[];

  beforeAll(async () => {
    folder = mkdtempSync(join(tmpdir(), 'tessera-world-'));
    cpSync(goldenScene, join(folder, 'golden.scene'), { recursive: true });
    cpSync(goldenScene, join(folder, 'towns/old.scene'), { recursive: true });
    for (const [name, edge] of [['a', 10], ['b c', 5]] as const) {
      mkdirSync(join(folder, name));
      writeFileSync(join(folder, name, 'cube.glb'), testGlb({ edge }));
    }
    writeFileSync(join(folder, 'world.json'), JSON.stringify(world));
    const lost = { ...world.models[0], name: 'lost', files: ['lost.glb'] };
    const gone = { ...world.scenes[0], url: 'https://localhost:1/gone.scene', name: 'Gone' };
    writeFileSync(join(folder, 'with gaps.json'), JSON.stringify({ ...world, scenes: [...world.scenes, gone], models: [...world.models, lost] }));
    const dark = { ...world, scenes: [{ ...world.scenes[1], visible: false }], models: [], hidden: [] };
    writeFileSync(join(folder, 'dark.json'), JSON.stringify(dark));
    [server, browser] = await Promise.all([serve(folder), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    rmSync(folder, { recursive: true });
  });
  beforeEach(async () => {
    await page?.close();
    page = await browser.newPage({ viewport: { width: 640, height: 400 } });
    said = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
  });

  async function open(hash = `#${kView}`, file = ''): Promise<void> {
    await page.goto('about:blank');
    await page.goto(`${server.url}${file && `?world=world/${encodeURIComponent(encodeURIComponent(file))}`}${hash}`);
    await page.waitForFunction(() => document.querySelectorAll('.models > ul .name').length >= 2);
    await page.waitForSelector('.loading.done', { state: 'attached' });
  }

  // Nothing is selected and no panel is open.
  async function picture(): Promise<Uint8Array> {
    await page.keyboard.press('Escape');
    await page.mouse.move(630, 390);
    return decodePixels(page, await pictureAtRest(page));
  }

  const isBesideToolbar = (pixel: number) => pixel % 640 >= 110; // the toolbar shows the focus
  function changed(a: Uint8Array, b: Uint8Array): number {
    return Array.from({ length: a.length / 3 }, (_, pixel) => pixel)
      .filter((pixel) => isBesideToolbar(pixel) && [0, 1, 2].some((c) => Math.abs(a[3 * pixel + c] - b[3 * pixel + c]) > 8)).length;
  }

  async function save(): Promise<typeof world> {
    const [download] = await Promise.all([page.waitForEvent('download'), page.click('.models button:text-is("Save")')]);
    return JSON.parse(readFileSync(await download.path(), 'utf8')) as typeof world;
  }

  async function drop(text: string): Promise<void> {
    await page.evaluate((one) => {
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File([one], 'world.json'));
      document.querySelector('#view')!.dispatchEvent(new DragEvent('drop', { dataTransfer, clientX: 300, clientY: 200, bubbles: true, cancelable: true }));
    }, text);
  }

  it('is shown completely, and saved unchanged', async () => {
    await open();
    await page.keyboard.press('b');
    await page.click('.views button:text-is("From the south")');
    const before = await picture();
    const red = Array.from({ length: before.length / 3 }, (_, pixel) => pixel)
      .filter((pixel) => before[3 * pixel] > 200 && before[3 * pixel + 1] < 40 && before[3 * pixel + 2] < 40).length;
    expect(red).toBeGreaterThan(500);
    await page.keyboard.press('o');
    expect(await page.$$eval('.scenes .name', (all) => all.map((one) => one.textContent))).toEqual(['golden', 'Old town']);
    expect(await page.$$eval('.models > ul .name', (all) => all.map((one) => one.textContent))).toEqual(['cube', 'cube 2']);
    const saved = await save();
    expect(saved).toMatchObject({
      ...world, scenes: [world.scenes[1], { ...world.scenes[0], url: 'towns/old.scene/tileset.json' }],
      models: [world.models[0], { ...world.models[1], name: 'cube 2' }],
    });
    expect(new Set((saved.models as unknown as { contents: string[] }[]).map(({ contents: [one] }) => one)).size).toBe(2);

    await page.click('.scenes [aria-label="Hide: Old town"]');
    const alone = await picture();
    expect(changed(before, alone)).toBeGreaterThan(2000);
    await drop(JSON.stringify({ ...saved, hidden: [] }));
    await page.waitForSelector('.scenes [aria-label="Hide: Old town"]', { state: 'attached' });
    const shown = await picture();
    expect(changed(before, shown)).toBeGreaterThan(300);
    await drop(JSON.stringify(saved));
    await page.waitForFunction(() => document.querySelectorAll('.hiding .name').length === 1);
    expect(changed(before, await picture())).toBeLessThan(30);
    expect(await page.isVisible('.error')).toBe(false);
    expect(said).toEqual([]);
  });

  it('is shown without missing items, which are reported and saved again', async () => {
    await open(`#${kView}`, 'with gaps.json');
    await page.waitForSelector('.error', { state: 'visible' });
    expect(await page.textContent('.error')).toMatch(/lost\.glb.*404.*And 1 more/);
    await page.click('.error button');
    await page.keyboard.press('o');
    const saved = await save();
    expect(saved.scenes.map(({ name }) => name)).toEqual(['golden', 'Old town', 'Gone']);
    expect(saved.models.map(({ name }) => name)).toEqual(['cube', 'cube 2', 'lost']);
  });

  it('without a visible scene finishes loading, and its scene can be shown', async () => {
    await page.goto(`${server.url}?world=world/dark.json#${kView}`);
    await page.waitForSelector('.loading.done', { state: 'attached' });
    await page.keyboard.press('o');
    const dark = await picture();
    await page.keyboard.press('o');
    await page.click('.scenes [aria-label="Show: golden"]');
    expect(changed(dark, await picture())).toBeGreaterThan(2000);
    expect(said).toEqual([]);
  });

  it('is unchanged if another one cannot be read', async () => {
    await open();
    await drop(JSON.stringify({ ...world, models: [{ ...world.models[0], files: [] }], hidden: [] }));
    await page.waitForSelector('.error', { state: 'visible' });
    expect(await page.textContent('.error')).toContain('Names no files');
    expect(await page.locator('.models > ul .name').count()).toBe(2);
    expect(await page.locator('.hiding .name').count()).toBe(1);
  });

  it('has parts hidden by a click, by handles and numbers', async () => {
    await open();
    await page.keyboard.press('x');
    await page.click('.hiding [aria-label="Delete: Part 1"]');
    const whole = await picture();
    await page.keyboard.press('x');
    await page.click('text=Hide a part…');
    await page.mouse.click(420, 230);
    await page.waitForSelector('.hiding li.on');
    await page.fill('.hiding .field:has-text("Height") input', '60');
    await page.fill('.hiding .field:has-text("Turn") input', '30');
    const without = await picture();
    expect(changed(whole, without)).toBeGreaterThan(300);
    await page.keyboard.press('o');
    expect((await save()).hidden).toMatchObject([{ name: 'Part 1', size: [expect.any(Number), expect.any(Number), 60], turn: expect.closeTo(Math.PI / 6, 3), hides: true }]);
    await page.keyboard.press('x');
    await page.click('.hiding [aria-label="Show: Part 1"]');
    expect(changed(whole, await picture())).toBeLessThan(30);
    expect(said).toEqual([]);
  });

  it('is rejected at startup if a scene is outside its folder', () => {
    const inside = join(folder, 'inside');
    mkdirSync(inside);
    writeFileSync(join(inside, 'world.json'), JSON.stringify({ ...world, scenes: [{ url: '../golden.scene' }] }));
    const { status, stderr } = spawnSync(program, ['serve', inside, '--viewer', viewer, '--port', '0'], { encoding: 'utf8', timeout: 10000 });
    expect(status).toBe(1);
    expect(stderr).toContain(`world.json: scenes[0].url: '../golden.scene' does not lie in '${inside}', and nothing else is served; put the scene into that folder`);
  });
});
