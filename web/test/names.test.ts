// Tests the names of views, models and hidden parts, which a saved world contains.
import { readFileSync } from 'node:fs';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { testGlb } from '../src/testing/test-glb';
import { goldenScene, launch, missing, serve, type Server } from './machine';

describe.skipIf(missing())('names', () => {
  let server: Server;
  let browser: Browser;
  let page: Page;
  const said: string[] = [];

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
    page = await browser.newPage({ viewport: { width: 800, height: 600 } });
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.goto(server.url);
    await page.waitForSelector('.loading.done', { state: 'attached' });
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
    expect(said).toEqual([]);
  });

  const listed = (panel: string) => page.$$eval(`${panel} > ul .name`, (all) => all.map((one) => one.textContent));
  const hasFocus = (selector: string) => page.$eval(selector, (one) => one === document.activeElement);

  // Renames the selected item of a panel: Enter keeps a name, Escape discards it, and an empty name restores the old
  // one.
  async function rename(panel: string, name: string): Promise<void> {
    const field = `${panel} .details .field:has-text("Name") input`;
    const old = await page.inputValue(field);
    await page.fill(field, 'Nobody');
    expect(await listed(panel)).toContain('Nobody');
    expect(await hasFocus(field)).toBe(true);
    await page.keyboard.press('Escape');
    expect(await page.inputValue(field)).toBe(old);
    expect(await listed(panel)).toContain(old);
    expect(await page.isVisible(panel)).toBe(true);
    await page.fill(field, ' ');
    await page.keyboard.press('Enter');
    expect(await page.inputValue(field)).toBe(old);
    await page.fill(field, ` ${name} `);
    await page.keyboard.press('Enter');
    expect(await page.inputValue(field)).toBe(name);
    expect(await listed(panel)).toContain(name);
  }

  it('can be edited, and are saved in worlds and, for views, in the browser', async () => {
    await page.keyboard.press('b');
    await page.click('text=Keep this view');
    await page.click('text=Keep this view');
    await rename('.views', 'Above <all>');
    await page.focus('.views [aria-label="Remove: View 1"]');
    await page.keyboard.press('Enter');
    expect(await listed('.views')).toEqual(['Above <all>']);
    expect(await hasFocus('.views [aria-label="Remove: Above <all>"]')).toBe(true);

    await page.keyboard.press('x');
    await page.click('text=Hide a part…');
    await page.mouse.click(600, 300);
    await page.waitForSelector('.hiding li.on');
    await rename('.hiding', 'Crane');

    await page.keyboard.press('o');
    await page.setInputFiles('.models input[type=file]', { name: 'cube.glb', mimeType: '', buffer: Buffer.from(testGlb({ edge: 10 })) });
    await page.waitForSelector('.models li.on');
    await rename('.models', 'Town hall');
    await page.focus('.models [aria-label="Hide: Town hall"]');
    await page.keyboard.press('Enter');
    expect(await hasFocus('.models [aria-label="Show: Town hall"]')).toBe(true);

    const [download] = await Promise.all([page.waitForEvent('download'), page.click('.models button:text-is("Save")')]);
    const world = JSON.parse(readFileSync(await download.path(), 'utf8')) as Record<string, { name: string }[]>;
    expect(world.models).toMatchObject([{ name: 'Town hall', visible: false }]);
    expect(world.hidden).toMatchObject([{ name: 'Crane' }]);
    expect(world.bookmarks).toMatchObject([{ name: 'Above <all>' }]);
    await page.reload();
    await page.waitForSelector('.loading.done', { state: 'attached' });
    await page.keyboard.press('b');
    expect(await listed('.views')).toEqual(['Above <all>']);
  });

  it('are committed by a click on another one, which takes effect', async () => {
    await page.click('text=Keep this view');
    await page.fill('.views .field input', 'Second');
    await page.click('.views .name:text-is("Above <all>")');
    expect(await listed('.views')).toEqual(['Above <all>', 'Second']);
    expect(await page.textContent('.views li.on .name')).toBe('Above <all>');
    expect(await page.inputValue('.views .field input')).toBe('Above <all>');
  });
});
