// Tests the library as users embed it: the page of web/example.
import { createReadStream } from 'node:fs';
import { createServer, type Server as HttpServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { goldenScene, launch, missing } from './machine';
import { countColours } from './pictures';

const kTypes: Record<string, string> = { '.html': 'text/html', '.js': 'text/javascript', '.json': 'application/json' };
const web = fileURLToPath(new URL('../', import.meta.url));

describe.skipIf(missing())('the library', () => {
  let files: HttpServer; // any static file server
  let browser: Browser;

  beforeAll(async () => {
    files = createServer(({ url }, answer) => {
      const path = normalize(decodeURIComponent(new URL(url!, 'http://host').pathname));
      const file = path.startsWith('/garden/') ? join(goldenScene, path.slice('/garden'.length)) : join(web, path);
      answer.setHeader('content-type', kTypes[extname(file)] ?? 'application/octet-stream');
      createReadStream(file).on('error', () => answer.writeHead(404).end()).pipe(answer);
    });
    await new Promise<void>((resolve) => files.listen(0, '127.0.0.1', resolve));
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
    files.close();
  });

  it('draws a scene and a model on a page of three.js', async () => {
    const page = await browser.newPage({ viewport: { width: 400, height: 240 } });
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    const { port } = files.address() as AddressInfo;
    await page.goto(`http://127.0.0.1:${port}/example/index.html?scene=/garden`);
    await expect.poll(() => countColours(page), { timeout: 30000 }).toBeGreaterThan(200);
    expect(said).toEqual([]);
    await page.goto(`http://127.0.0.1:${port}/example/index.html?scene=/nothing`);
    await expect.poll(() => page.textContent('body')).toContain('/nothing/tileset.json: the server answered 404');
    await page.close();
  });
});
