// Tests the viewer on a phone: overlays leave the image free, and touch replaces the mouse.
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { goldenScene, launch, missing, serve, type Server } from './machine';

interface Box {
  name: string;
  left: number;
  top: number;
  right: number;
  bottom: number;
}

const kPhones = [[390, 844], [844, 390], [360, 640], [640, 360], [320, 568]] as const;
const kDesktops = [[1280, 720], [1024, 560]] as const;

describe.skipIf(missing())('on a phone', { timeout: 120000 }, () => {
  let server: Server;
  let browser: Browser;

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
  });

  async function open([width, height]: readonly [number, number], isPhone: boolean, visit: (page: Page) => Promise<void>): Promise<void> {
    const page = await browser.newPage({ viewport: { width, height }, isMobile: isPhone, hasTouch: isPhone });
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    try {
      await page.goto(server.url);
      await page.waitForSelector('.loading.done', { state: 'attached' });
      await visit(page);
      expect(said).toEqual([]);
    } finally {
      await page.close();
    }
  }

  function boxes(page: Page, selector: string): Promise<Box[]> {
    return page.$$eval(selector, (all) => all.filter((one) => one.checkVisibility()).map((one) => {
      const { left, top, right, bottom } = one.getBoundingClientRect();
      return { name: one.getAttribute('aria-label') ?? one.className, left, top, right, bottom };
    }));
  }

  const overlap = (a: Box, b: Box) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;

  // All overlays that can be open at once.
  async function showAll(page: Page): Promise<void> {
    await page.keyboard.press('i');
    await page.evaluate(() => {
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File(['garbage'], 'x.glb'));
      document.querySelector('#view')!.dispatchEvent(new DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true }));
    });
    await page.waitForSelector('.error', { state: 'visible' });
    await page.waitForSelector('.drop', { state: 'hidden' });
    await page.addStyleTag({ content: '.loading { display: block !important }' });
  }

  it.each([...kPhones, ...kDesktops])('no overlays overlap, and panels leave the middle of the image free: %i × %i', async (width, height) => {
    await open([width, height], kPhones.some(([x, y]) => x === width && y === height), async (page) => {
      await showAll(page);
      const middle = { name: 'the middle', left: width / 2 - 1, right: width / 2 + 1, top: height / 2 - 1, bottom: height / 2 + 1 };
      const tools = await boxes(page, '.toolbar button');
      expect(tools.length).toBeGreaterThanOrEqual(12);
      for (const { left, top, right, bottom } of tools) {
        expect(Math.min(right - left, bottom - top)).toBeGreaterThan(39.9);
        expect(left >= 0 && top >= 0 && right <= width && bottom <= height).toBe(true);
      }
      for (const { name } of tools.filter(({ name }) => /^(Measure|Models|Hide parts|Views|Image|Settings|Help)$/.test(name))) {
        await page.locator(`.toolbar [aria-label="${name}"]`).click();
        const glass = await boxes(page, '.glass');
        expect(glass).toHaveLength(5);
        const covered = glass.flatMap((a, i) => glass.slice(i + 1).filter((b) => overlap(a, b)).map((b) => `${a.name}, ${b.name}`));
        expect(covered).toEqual([]);
        const side = glass.find((one) => one.name === name)!;
        expect(overlap(side, middle)).toBe(false);
        expect(side.bottom - side.top).toBeGreaterThan(80);
        for (const one of glass) expect(one.left >= 0 && one.top >= 0 && one.right <= width && one.bottom <= height).toBe(true);
      }
    });
  });

  it('a distance is measured by taps, taken back and ended', async () => {
    await open([390, 844], true, async (page) => {
      const [undo, done] = ['Undo', 'Done'].map((name) => page.locator(`.measure button:text-is("${name}")`));
      await page.tap('[aria-label=Measure]');
      expect(await page.textContent('.measure .task p')).toBe('Tap along it; Done ends.');
      expect(await done.isVisible()).toBe(false);
      const tap = async (x: number, y: number) => {
        await page.touchscreen.tap(x, y);
        await page.waitForTimeout(450); // separate taps, not a double tap
      };
      await tap(150, 320);
      await undo.waitFor();
      expect(await done.isDisabled()).toBe(true);
      await tap(240, 320);
      expect(await done.isDisabled()).toBe(false);
      const length = () => page.locator('.measure .figures dd').first().textContent();
      const first = await length();
      await tap(200, 250);
      expect(await length()).not.toBe(first);
      await undo.tap();
      expect(await length()).toBe(first);
      await done.tap();
      expect(await undo.isVisible()).toBe(false);
      expect(await page.locator('.measure li').count()).toBe(1);
      expect(await page.textContent('.measure li .figure')).toBe(first);
      // With a keyboard: the focus moves to a control that can take it.
      await tap(150, 320);
      await undo.focus();
      await page.keyboard.press('Enter');
      expect(await undo.isVisible()).toBe(false);
      expect(await page.evaluate(() => document.activeElement?.textContent)).toBe('Distance');
    });
  });
});
