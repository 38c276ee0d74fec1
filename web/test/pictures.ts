// Renders images with the CPU renderer, for comparison.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import type { View } from '../src/headless-page';
import type { Tileset } from '../src/tiles/tileset';
import { kFieldOfView, kHeight, kWidth } from './views';

// Returns a camera path in nerfstudio's format, in the world of the photos' source; matrices are row-major.
export function cameraPath(tileset: Tileset, matrices: number[][], width = kWidth, height = kHeight): string {
  const s = tileset.sourceFromWorld;
  const scale = Math.hypot(s[0], s[1], s[2]);
  const camera_path = matrices.map((m) => {
    const rows = [0, 1, 2].map((row) =>
      [0, 1, 2, 3].map((column) => {
        const sum = s[row] * m[4 * column] + s[4 + row] * m[4 * column + 1] + s[8 + row] * m[4 * column + 2];
        return column < 3 ? sum / scale : sum + s[12 + row];
      }),
    );
    return { camera_to_world: [...rows.flat(), 0, 0, 0, 1], fov: kFieldOfView, aspect: width / height };
  });
  return JSON.stringify({
    camera_type: 'perspective', render_width: width, render_height: height, fps: matrices.length, seconds: 1, camera_path,
  });
}

// A photo's view as seen by the tests' pinhole camera.
export interface CapturedView {
  view: View;
  lens: number[]; // the photo's own OpenCV parameters: fx fy cx cy k1 k2 p1 p2
  depthFile: string; // in the capture
}

// Returns held-out photos of a capture; if there are too few, the first of the others as well.
export function capturedViews(capture: string, count: number): CapturedView[] {
  const { test_filenames, train_filenames, frames, tessera } = JSON.parse(readFileSync(join(capture, 'transforms.json'), 'utf8')) as {
    test_filenames: string[];
    train_filenames: string[];
    frames: { file_path: string; depth_file_path: string; transform_matrix: number[][] }[];
    tessera: { cameras: { parameters: number[] }[] };
  };
  const focal = kHeight / 2 / Math.tan((kFieldOfView * Math.PI) / 360);
  return [...test_filenames, ...train_filenames].slice(0, count).map((name) => {
    const { transform_matrix: rows, depth_file_path: depthFile } = frames.find((frame) => frame.file_path === name)!;
    const matrix = [0, 1, 2, 3].flatMap((column) => [0, 1, 2, 3].map((row) => rows[row]?.[column] ?? (column === 3 ? 1 : 0)));
    const view = { matrix, fx: focal, fy: focal, cx: kWidth / 2, cy: kHeight / 2, width: kWidth, height: kHeight };
    return { view, lens: tessera.cameras[0].parameters, depthFile };
  });
}

// Returns the number of colours in the middle of the page's image; one if nothing is drawn.
export async function countColours(page: Page): Promise<number> {
  const { width, height } = page.viewportSize()!;
  const clip = { x: width / 4, y: height / 4, width: width / 2, height: height / 4 };
  const pixels = await decodePixels(page, await page.screenshot({ clip }));
  const colours = new Set<number>();
  for (let at = 0; at < pixels.length; at += 3) colours.add(pixels[at] | (pixels[at + 1] << 8) | (pixels[at + 2] << 16));
  return colours.size;
}

// Waits until everything has loaded and two screenshots in a row are the same, and returns the second. Frames of the
// page lie before and between them: a change that the page has not drawn yet, or a resolution that it has not raised yet
// after a motion, would otherwise give two equal screenshots on a busy machine.
export async function pictureAtRest(page: Page): Promise<Buffer> {
  const loaded = async () => {
    await waitForFrames(page, 3);
    await page.waitForSelector('.loading.done', { state: 'attached' });
  };
  await loaded();
  let picture = await page.screenshot();
  for (;;) {
    await page.waitForTimeout(400); // longer than the viewer takes to count as being at rest
    await loaded();
    const next = await page.screenshot();
    if (next.equals(picture)) return next;
    picture = next;
  }
}

function waitForFrames(page: Page, count: number): Promise<void> {
  return page.evaluate(async (frames) => {
    for (let i = 0; i < frames; ++i) await new Promise(requestAnimationFrame);
  }, count);
}

// Compares two images; toEqual takes seconds for this.
export function isSame(a: Uint8Array, b: Uint8Array): boolean {
  return Buffer.compare(a, b) === 0;
}

export function psnr(a: Uint8Array, b: Uint8Array): number {
  if (a.length !== b.length) throw new Error('pictures of different sizes');
  const squares = a.reduce((sum, value, i) => sum + (value - b[i]) ** 2, 0);
  return 10 * Math.log10((255 ** 2 * a.length) / squares);
}

// Returns the RGB values of a PNG, decoded by the browser.
export function decodePng(page: Page, file: string): Promise<Uint8Array> {
  return decodePixels(page, readFileSync(file));
}

export async function decodePixels(page: Page, png: Buffer): Promise<Uint8Array> {
  const text = await page.evaluate(async (base64) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    let bytes = '';
    for (let i = 0; i < data.length; ++i) if (i % 4 < 3) bytes += String.fromCharCode(data[i]);
    return btoa(bytes);
  }, png.toString('base64'));
  return new Uint8Array(Buffer.from(text, 'base64'));
}
