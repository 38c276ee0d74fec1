// Compares views of a scene in the browser with those of the CPU renderer.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { run } from '../test/machine';
import { cameraPath, capturedViews, decodePng, psnr } from '../test/pictures';

declare const headlessPage: HeadlessPage;

export function loadTileset(scene: string) {
  return decodeTileset(readFileSync(join(scene, 'tileset.json'), 'utf8'), 'tileset.json', kCodecs);
}

// Returns the PSNR in dB and the seconds per frame of each of the first held-out views; `page` is a headless page on
// the server of this scene. Leaves both images in `folder`.
export async function againstOracle(
  page: Page, scene: string, capture: string, folder: string, count = 10,
): Promise<{ decibels: number[]; seconds: number[] }> {
  const views: View[] = capturedViews(capture, count).map(({ view }) => view);
  mkdirSync(folder, { recursive: true });
  const path = join(folder, 'path.json');
  writeFileSync(path, cameraPath(loadTileset(scene), views.map(({ matrix }) => matrix)));
  run('render', scene, join(folder, 'oracle'), '--path', path);
  await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
  await page.evaluate(() => (headlessPage.city!.antialiases = false)); // the CPU shows the middle of pixels
  const decibels: number[] = [];
  const seconds: number[] = [];
  for (const [i, view] of views.entries()) {
    await page.evaluate((one) => headlessPage.settle(one), view);
    const pixels = new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
    const url = await page.evaluate(() => document.querySelector('canvas')!.toDataURL());
    writeFileSync(join(folder, `browser-${i}.png`), Buffer.from(url.slice(url.indexOf(',') + 1), 'base64'));
    decibels.push(psnr(pixels, await decodePng(page, join(folder, 'oracle', `0000${i}.png`))));
    seconds.push(await page.evaluate((one) => headlessPage.time(one, 3), view));
  }
  return { decibels, seconds };
}

export function tell(decibels: number[], seconds: number[]): void {
  console.log(`PSNR against the oracle: ${decibels.map((value) => value.toFixed(1)).join(', ')} dB`);
  console.log(`a frame: ${seconds.map((value) => value.toFixed(2)).join(', ')} s`);
}
