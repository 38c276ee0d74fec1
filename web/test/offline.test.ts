// Tests the viewer as a single file from disk, without any server.
import { existsSync } from 'node:fs';
import { pathToFileURL } from 'node:url';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { goldenScene, launch, missing, viewer } from './machine';
import { countColours } from './pictures';

describe.skipIf(missing())('the viewer as a local file', () => {
  let browser: Browser;

  beforeAll(async () => {
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
  });

  it('shows the scene of a chosen folder, and reports a folder without one', async () => {
    expect(existsSync(`${viewer}/offline.html`)).toBe(true);
    const page = await browser.newPage({ viewport: { width: 480, height: 270 } });
    const said: string[] = [];
    const asked: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    page.on('request', (request) => /^(https?|wss?):/.test(request.url()) && asked.push(request.url()));
    await page.goto(pathToFileURL(`${viewer}/offline.html`).href);
    await page.setInputFiles('input[type=file]', `${viewer}/assets`);
    await page.waitForSelector('.error', { state: 'visible' });
    expect(await page.textContent('.error')).toContain('Holds no tileset.json');
    await page.setInputFiles('input[type=file]', goldenScene);
    await page.waitForSelector('.loading.done', { state: 'attached' });
    await page.waitForFunction(() => document.title === 'golden · tessera');
    expect(await page.isVisible('.error')).toBe(false);
    await expect.poll(() => countColours(page), { timeout: 20000 }).toBeGreaterThan(200);
    expect(said).toEqual([]);
    expect(asked).toEqual([]);
    await page.close();
  });
});
