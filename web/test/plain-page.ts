// The page with nothing around it (src/plain.ts), opened.
import type { Browser, BrowserContext, Page } from 'playwright-core';
import type { Server } from './machine';

// A window of each browser, whose pages are its tabs: a window takes as long to open as the page itself.
const windows = new WeakMap<Browser, BrowserContext>();

async function windowOf(browser: Browser): Promise<BrowserContext> {
  const known = windows.get(browser);
  if (known) return known;
  const context = await browser.newContext();
  await context.newPage(); // which stays, and the window with it
  windows.set(browser, context);
  return context;
}

// Errors that it says are added to `said`. `before`: put into the page before its own scripts.
export async function openPlain(browser: Browser, server: Server, said: string[], before?: () => void): Promise<Page> {
  const page = await (await windowOf(browser)).newPage();
  if (before) await page.addInitScript(before);
  page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
  page.on('pageerror', (error) => said.push(error.message));
  await page.goto(`${server.url}plain.html`);
  await page.waitForFunction(() => 'plain' in window);
  return page;
}
