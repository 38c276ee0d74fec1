// Opens the headless page (src/headless-page.ts).
import type { Browser, BrowserContext, Page } from 'playwright-core';
import type { Server } from './machine';

// One window per browser, whose pages are its tabs, as a window takes as long to open as the page itself.
const windows = new WeakMap<Browser, BrowserContext>();

async function browserWindow(browser: Browser): Promise<BrowserContext> {
  const known = windows.get(browser);
  if (known) return known;
  const context = await browser.newContext();
  await context.newPage(); // this tab stays open, and the window with it
  windows.set(browser, context);
  return context;
}

// Error messages of the page are added to `said`. `before` is injected before the page's own scripts.
export async function openHeadlessPage(browser: Browser, server: Server, said: string[], before?: () => void): Promise<Page> {
  const page = await (await browserWindow(browser)).newPage();
  if (before) await page.addInitScript(before);
  page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
  page.on('pageerror', (error) => said.push(error.message));
  await page.goto(`${server.url}headless.html`);
  await page.waitForFunction(() => 'headlessPage' in window);
  return page;
}
