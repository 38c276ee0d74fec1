// Tests a headset emulated by Meta's emulator: both eyes are side by side on the canvas. By pixels, and by user
// interaction.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import type { HeadlessPage, View } from '../src/headless-page';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenScene, launch, missing, serve, type Server } from './machine';
import { decodePixels, psnr } from './pictures';
import { worldFromCamera, type Place } from './views';

declare const headlessPage: HeadlessPage;
declare const headset: {
  controllers: Record<'left' | 'right', { updateAxes(id: 'thumbstick', x: number, y: number): void }>;
  activeSession?: { requestAnimationFrame(then: () => void): void };
};

const kEmulator = fileURLToPath(new URL('../node_modules/iwer/build/iwer.min.js', import.meta.url));
const kEdge = 320; // pixels of an eye's image, which spans 90°
const kBetweenEyes = 2; // metres: as for a giant, so that the eyes see different things

// In the golden scene a building occupies |x + 1| < 0.4, |y| < 0.3.
const kEye: Place = [-1, -2.2, 0.3];
const kTarget: Place = [-1, 0, 0.3];

describe.skipIf(missing())('a headset', () => {
  let server: Server;
  let browser: Browser;
  const tileset = decodeTileset(readFileSync(`${goldenScene}/tileset.json`, 'utf8'), 'tileset.json', kCodecs);
  const middle = worldFromCamera(tileset, kEye, kTarget);
  // Returns what each eye should see.
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

  // Returns the images of the two eyes from an image of both.
  function halves(both: Uint8Array): Uint8Array[] {
    return [0, 1].map((side) => both.filter((_, at) => Math.floor((at % (6 * kEdge)) / (3 * kEdge)) === side));
  }

  async function expectSame(page: Page, sides: Uint8Array[], minimum: number): Promise<void> {
    for (const [i, eye] of eyes.entries()) {
      await page.evaluate((view) => headlessPage.settle(view), eye);
      const alone = new Uint8Array(Buffer.from(await page.evaluate(() => headlessPage.pixels()), 'base64'));
      expect(new Set(alone).size).toBeGreaterThan(20); // something is visible
      expect(psnr(sides[i], alone)).toBeGreaterThan(minimum);
    }
  }

  // Waits until the headset has shown `count` more frames.
  const pictures = (page: Page) => page.evaluate(() => new Promise<void>((resolve) => {
    let left = 5;
    const next = () => (--left === 0 ? resolve() : headset.activeSession!.requestAnimationFrame(next));
    next();
  }));

  async function openHeadlessPage(page: Page): Promise<void> {
    await page.waitForFunction(() => 'headlessPage' in window);
    await page.evaluate(() => headlessPage.open('scene/tileset.json', { selection: { maximumScreenSpaceError: 0 } }));
  }

  it('shows each eye what a camera in its place sees, with models in front of and behind the scene', async () => {
    await open('headless.html', async (page) => {
      await openHeadlessPage(page);
      await page.evaluate(() => headlessPage.addBox([-1.3, -0.9, 0.2], [-1.2, 0, 0.4])); // in front of the facade, and half inside it
      const text = await page.evaluate(async (matrix) => {
        const { THREE, renderer, world, city } = headlessPage;
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
            // y up from z up; the head is placed so that the midpoint of the eyes is at `eye`.
            new THREE.Matrix4().makeRotationX(-Math.PI / 2)
              .multiply(new THREE.Matrix4().fromArray(matrix))
              .multiply(new THREE.Matrix4().fromArray([...head.matrix]).invert())
              .decompose(rig.position, rig.quaternion, rig.scale);
            // The head was elsewhere before: the image must show its current pose.
            const isLast = ++drawn > 3 && city!.idle;
            if (!isLast) rig.position.x += 3;
            city!.update(camera, renderer);
            renderer.render(world, camera);
            if (isLast) resolve(headlessPage.pixels());
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

  it('is entered by the button, shows the scene to both eyes, and moves by the sticks; the view stays afterwards', async () => {
    let seen: Uint8Array[] = [];
    const world = (place: Place) => worldFromCamera(tileset, place, [place[0], place[1] + 1, place[2]]).slice(12, 15);
    const near = (a: number[], b: number[]) => Math.hypot(...a.map((x, i) => x - b[i]));
    await open(`#eye=${world(kEye)}&target=${world(kTarget)}&fov=60`, async (page) => {
      const where = (of: string) =>
        page.evaluate((name) => new URLSearchParams(location.hash.slice(1)).get(name)!.split(',').map(Number), of);
      await page.waitForSelector('.loading.done', { state: 'attached' });
      await page.keyboard.press('c');
      await page.selectOption('label:has-text("Pixels") select', '100 %');
      await page.selectOption('label:has-text("Outside the captured region") select', 'Is shown in full');
      await page.fill('label:has-text("Screen-space error") input', '0');
      await page.click('[aria-label=Headset]');
      await page.waitForFunction(() => headset.activeSession !== undefined);
      await pictures(page);
      await page.waitForSelector('.loading.done', { state: 'attached' });
      await pictures(page);
      seen = halves(await decodePixels(page, await page.screenshot()));
      expect(near(await where('eye'), world(kEye))).toBeLessThan(1e-3);
      // A step to the right, and then onwards in the direction of the gaze.
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
      await page.keyboard.press('v'); // instead of the button, which the emulator covers
      await expect.poll(() => where('fov'), { timeout: 10000 }).toEqual([60]);
      expect(near(await where('eye'), there)).toBeLessThan(1e-3);
      expect(await page.getAttribute('[aria-label=Headset]', 'aria-pressed')).toBe('false');
      const size = await page.evaluate(() => {
        const { width, height } = document.querySelector<HTMLCanvasElement>('#view')!;
        return [width, height];
      });
      expect(size).toEqual([2 * kEdge, kEdge]);
    });
    await open('headless.html', async (page) => {
      await openHeadlessPage(page);
      await expectSame(page, seen, 40);
    });
  });

  it('reports why it shows nothing', async () => {
    await open('', async (page) => {
      await page.click('[aria-label=Headset]');
      await page.waitForSelector('.error', { state: 'visible' });
      const text = await page.textContent('.error');
      expect(text).toContain('permission denied');
      expect(text).toContain('allow the page to use it');
    }, false);
  });
});

describe.skipIf(missing())('the toolbar without a headset', () => {
  it('has no button for it', async () => {
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
