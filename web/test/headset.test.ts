// A headset, as Meta's emulator has it: both eyes beside one another on the canvas. By pixels, and as people use it.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { Plain, View } from '../src/plain';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenScene, launch, missing, serve, type Server } from './machine';
import { decodePixels, psnr } from './pictures';
import { worldFromCamera, type Place } from './views';

declare const plain: Plain;
declare const headset: {
  controllers: Record<'left' | 'right', { updateAxes(id: 'thumbstick', x: number, y: number): void }>;
  activeSession?: { requestAnimationFrame(then: () => void): void };
};

const kEmulator = fileURLToPath(new URL('../node_modules/iwer/build/iwer.min.js', import.meta.url));
const kEdge = 320; // pixels of an eye's picture, of 90°
const kBetweenEyes = 2; // metres: of a giant, so that they see different things

// In the golden scene a building stands at |x + 1| < 0.4, |y| < 0.3.
const kEye: Place = [-1, -2.2, 0.3];
const kTarget: Place = [-1, 0, 0.3];

describe.skipIf(missing())('with a headset', () => {
  let server: Server;
  let browser: Browser;
  const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
  const middle = worldFromCamera(tileset, kEye, kTarget);
  // What each eye should see.
  const eyes = [-1, 1].map((side): View => {
    const matrix = middle.map((value, i) => (i >= 12 && i < 15 ? value + side * 0.5 * kBetweenEyes * middle[i - 12] : value));
    return { matrix, fx: kEdge / 2, fy: kEdge / 2, cx: kEdge / 2, cy: kEdge / 2, width: kEdge, height: kEdge };
  });

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
  });

  async function open(path: string, visit: (page: Page) => Promise<void>, sessions = true): Promise<void> {
    const page = await browser.newPage({ viewport: { width: 2 * kEdge, height: kEdge } });
    const said: string[] = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    await page.addInitScript({ path: kEmulator });
    await page.addInitScript(([grants, ipd]) => {
      const { IWER } = window as unknown as { IWER: any };
      const device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true, visibilityMask: null, ipd });
      device.installRuntime({ forceInstall: true });
      if (!grants) navigator.xr!.requestSession = () => Promise.reject(new DOMException('permission denied', 'NotAllowedError'));
      Object.assign(window, { headset: device });
    }, [sessions, kBetweenEyes] as const);
    await page.goto(`${server.url}${path}`);
    await visit(page);
    expect(said).toEqual([]);
    await page.close();
  }

  // The eyes' pictures, of one of both.
  function halves(both: Uint8Array): Uint8Array[] {
    return [0, 1].map((side) => both.filter((_, at) => Math.floor((at % (6 * kEdge)) / (3 * kEdge)) === side));
  }

  async function expectSame(page: Page, sides: Uint8Array[], least: number): Promise<void> {
    for (const [i, eye] of eyes.entries()) {
      await page.evaluate((view) => plain.settle(view), eye);
      const alone = new Uint8Array(Buffer.from(await page.evaluate(() => plain.pixels()), 'base64'));
      expect(new Set(alone).size).toBeGreaterThan(20); // something is to be seen
      expect(psnr(sides[i], alone)).toBeGreaterThan(least);
    }
  }

  // Until the headset has shown so many more.
  const pictures = (page: Page) => page.evaluate(() => new Promise<void>((resolve) => {
    let left = 5;
    const next = () => (--left === 0 ? resolve() : headset.activeSession!.requestAnimationFrame(next));
    next();
  }));

  async function openPlain(page: Page): Promise<void> {
    await page.waitForFunction(() => 'plain' in window);
    await page.evaluate(() => plain.open('scene/tileset.json', { selection: { mostPixels: 0 } }));
  }

  it('each eye sees what a camera in its place sees, with models before and behind the scene', async () => {
    await open('plain.html', async (page) => {
      await openPlain(page);
      await page.evaluate(() => plain.addBox([-1.3, -0.9, 0.2], [-1.2, 0, 0.4])); // before the facade, and half in it
      const text = await page.evaluate(async (matrix) => {
        const { THREE, renderer, world, city } = plain;
        const rig = new THREE.Group();
        const camera = new THREE.PerspectiveCamera(50, 1, 0.1, 1e4);
        rig.add(camera);
        world.add(rig);
        const { xr } = renderer;
        xr.enabled = true;
        xr.setReferenceSpaceType('local');
        const session = await navigator.xr!.requestSession('immersive-vr');
        const seen = new Promise<string>((resolve) => {
          let drawn = 0;
          renderer.setAnimationLoop(() => {
            if (!xr.isPresenting) return;
            const head = xr.getFrame().getViewerPose(xr.getReferenceSpace()!)!.transform;
            // y up from z up, and the head where the eyes' middle is to be.
            new THREE.Matrix4().makeRotationX(-Math.PI / 2)
              .multiply(new THREE.Matrix4().fromArray(matrix))
              .multiply(new THREE.Matrix4().fromArray([...head.matrix]).invert())
              .decompose(rig.position, rig.quaternion, rig.scale);
            // Elsewhere before: the picture is of where the head is now.
            const isLast = ++drawn > 3 && city!.idle;
            if (!isLast) rig.position.x += 3;
            city!.update(camera, renderer);
            renderer.render(world, camera);
            if (isLast) resolve(plain.pixels());
          });
        });
        await xr.setSession(session);
        const pixels = await seen;
        renderer.setAnimationLoop(null);
        await session.end();
        xr.enabled = false;
        return pixels;
      }, middle);
      const both = new Uint8Array(Buffer.from(text, 'base64'));
      const red = both.filter((value, at) => at % 3 === 0 && value > 235 && both[at + 1] < 20).length;
      expect(red).toBeGreaterThan(500);
      const [left, right] = halves(both);
      expect(psnr(left, right)).toBeLessThan(30);
      await expectSame(page, [left, right], 60);
    });
  });

  it('one enters by the button, sees the scene with both eyes, moves by the sticks, and stays there', async () => {
    let seen: Uint8Array[] = [];
    const world = (place: Place) => worldFromCamera(tileset, place, [place[0], place[1] + 1, place[2]]).slice(12, 15);
    const near = (a: number[], b: number[]) => Math.hypot(...a.map((x, i) => x - b[i]));
    await open(`#eye=${world(kEye)}&target=${world(kTarget)}&fov=60`, async (page) => {
      const where = (of: string) =>
        page.evaluate((name) => new URLSearchParams(location.hash.slice(1)).get(name)!.split(',').map(Number), of);
      await page.waitForSelector('.loading.done', { state: 'attached' });
      await page.keyboard.press('c');
      await page.selectOption('label:has-text("Pixels") select', '100 %');
      await page.selectOption('label:has-text("Beyond what was captured") select', 'As it was made up');
      await page.fill('label:has-text("Error at most") input', '0');
      await page.click('[aria-label=Headset]');
      await page.waitForFunction(() => headset.activeSession !== undefined);
      await pictures(page);
      await page.waitForSelector('.loading.done', { state: 'attached' });
      await pictures(page);
      seen = halves(await decodePixels(page, await page.screenshot()));
      expect(near(await where('eye'), world(kEye))).toBeLessThan(1e-3);
      // To the right by a step, and then, with the gaze, onwards.
      await page.evaluate(() => headset.controllers.right.updateAxes('thumbstick', 1, 0));
      await pictures(page);
      await page.evaluate(() => headset.controllers.left.updateAxes('thumbstick', 0, -1));
      await pictures(page);
      await page.evaluate(() => headset.controllers.left.updateAxes('thumbstick', 0, 0));
      await expect.poll(async () => near(await where('eye'), world(kEye)), { timeout: 10000 }).toBeGreaterThan(1);
      const there = await where('eye');
      const gone = there.map((x, i) => x - world(kEye)[i]);
      expect(gone[2]).toBeCloseTo(0, 3);
      const along = (column: number) => middle[4 * column] * gone[0] + middle[4 * column + 1] * gone[1];
      expect(Math.atan2(along(0), -along(2))).toBeCloseTo(Math.PI / 6, 2);
      await page.keyboard.press('v'); // as the button, which the emulator stands before
      await expect.poll(() => where('fov'), { timeout: 10000 }).toEqual([60]);
      expect(near(await where('eye'), there)).toBeLessThan(1e-3);
      expect(await page.getAttribute('[aria-label=Headset]', 'aria-pressed')).toBe('false');
      const size = await page.evaluate(() => {
        const { width, height } = document.querySelector<HTMLCanvasElement>('#view')!;
        return [width, height];
      });
      expect(size).toEqual([2 * kEdge, kEdge]);
    });
    await open('plain.html', async (page) => {
      await openPlain(page);
      await expectSame(page, seen, 40);
    });
  });

  it('one is told why it shows nothing', async () => {
    await open('', async (page) => {
      await page.click('[aria-label=Headset]');
      await page.waitForSelector('.error', { state: 'visible' });
      const text = await page.textContent('.error');
      expect(text).toContain('permission denied');
      expect(text).toContain('allow the page to use it');
    }, false);
  });
});

describe.skipIf(missing())('without a headset', () => {
  it('there is no button', async () => {
    const [server, browser] = await Promise.all([serve(goldenScene), launch()]);
    const page = await browser.newPage();
    await page.goto(server.url);
    await page.waitForSelector('.loading.done', { state: 'attached' });
    expect(await page.isVisible('[aria-label=Help]')).toBe(true);
    expect(await page.isVisible('[aria-label=Headset]')).toBe(false);
    await browser.close();
    server.close();
  });
});
