// The page with nothing around it (src/plain.ts), opened.
import type { Browser, Page } from 'playwright-core';
import type { Server } from './machine';

// Errors that it says are added to `said`. `before`: put into the page before its own scripts.
export async function openPlain(browser: Browser, server: Server, said: string[], before?: () => void): Promise<Page> {
  const page = await browser.newPage();
  if (before) await page.addInitScript(before);
  page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
  page.on('pageerror', (error) => said.push(error.message));
  await page.goto(`${server.url}plain.html`);
  await page.waitForFunction(() => 'plain' in window);
  return page;
}
