// Tests models that users drop onto the viewer, and the world that they save, by pixels.
import { readFileSync } from 'node:fs';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import { testGlb } from '../src/testing/test-glb';
import { goldenScene, launch, missing, serve, type Server } from './machine';
import { decodePixels, pictureAtRest } from './pictures';

interface Given {
  name: string;
  bytes: Uint8Array;
}

const kMiddle = { x: 300, y: 135 }; // beside the panel
const cube: Given = { name: 'red cube.glb', bytes: testGlb({ edge: 10 }) };

describe.skipIf(missing())('a model that is dropped', () => {
  let server: Server;
  let browser: Browser;
  let page: Page;
  let said: string[];
  let asked: string[];

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(goldenScene), launch()]);
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
  });
  beforeEach(async () => {
    await page?.close();
    page = await browser.newPage({ viewport: { width: 480, height: 270 } });
    said = [];
    asked = [];
    page.on('console', (message) => message.type() === 'error' && said.push(message.text()));
    page.on('pageerror', (error) => said.push(error.message));
    page.on('request', (request) => asked.push(request.url()));
    await reload();
  });

  async function reload(): Promise<void> {
    await page.goto(server.url);
    await page.waitForSelector('.loading.done', { state: 'attached' });
  }

  async function drop(...files: Given[]): Promise<void> {
    await dropAt(kMiddle, ...files);
  }

  async function dropAt(place: { x: number; y: number }, ...files: Given[]): Promise<void> {
    const texts = files.map(({ name, bytes }) => ({ name, base64: Buffer.from(bytes).toString('base64') }));
    await page.evaluate(async ([all, { x, y }]) => {
      const dataTransfer = new DataTransfer();
      for (const { name, base64 } of all) {
        dataTransfer.items.add(new File([Uint8Array.from(atob(base64), (one) => one.charCodeAt(0))], name));
      }
      const canvas = document.querySelector('#view')!;
      for (const kind of ['dragover', 'drop']) {
        canvas.dispatchEvent(new DragEvent(kind, { dataTransfer, clientX: x, clientY: y, bubbles: true, cancelable: true }));
      }
    }, [texts, place] as const);
  }

  const listed = (names: string[]) =>
    page.waitForFunction((all) => [...document.querySelectorAll('.models .name')].map((one) => one.textContent).join() === all, names.join());

  // Deselects everything, closes all panels, and counts the red pixels.
  async function picture(): Promise<{ pixels: Uint8Array; red: number }> {
    await page.keyboard.press('Escape');
    await page.mouse.move(470, 260);
    const pixels = await decodePixels(page, await pictureAtRest(page));
    let red = 0;
    for (let at = 0; at < pixels.length; at += 3) if (pixels[at] > 200 && pixels[at + 1] < 40 && pixels[at + 2] < 40) ++red;
    return { pixels, red };
  }

  async function errorText(): Promise<string> {
    await page.waitForSelector('.error', { state: 'visible' });
    return (await page.textContent('.error'))!;
  }

  async function save(button: string): Promise<Given> {
    const [download] = await Promise.all([page.waitForEvent('download'), page.click(`.models button:text-is("${button}")`)]);
    expect(download.suggestedFilename()).toBe('world.json');
    return { name: 'world.json', bytes: readFileSync(await download.path()) };
  }

  it('is drawn, and again after it was saved and opened', async () => {
    expect((await picture()).red).toBe(0);
    await drop(cube);
    await listed(['red cube']);
    expect(await page.textContent('.models .details')).toContain('10.0 × 10.0 × 10.0 m');
    const alone = await save('Save');
    const whole = await save('Save with models');
    const { models } = JSON.parse(Buffer.from(alone.bytes).toString()) as { models: { rotation: number[]; scale: number[] }[] };
    expect(models).toMatchObject([{ name: 'red cube', files: ['red cube.glb'], rotation: [0, 0, 0, 1], scale: [1, 1, 1], visible: true }]);
    const before = await picture();
    expect(before.red).toBeGreaterThan(500);

    for (const files of [[alone, cube], [whole]]) {
      await reload();
      await drop(...files);
      await listed(['red cube']);
      const after = await picture();
      const isBesideToolbar = (i: number) => Math.floor(i / 3) % 480 >= 150; // the toolbar shows the focus
      const changed = after.pixels.filter((value, i) => isBesideToolbar(i) && Math.abs(value - before.pixels[i]) > 8).length;
      expect(changed).toBeLessThan(30);
    }
    expect(said).toEqual([]);
  });

  it('is hidden, moved by numbers, copied and deleted', async () => {
    await page.keyboard.press('o');
    await page.setInputFiles('.models input[type=file]', { name: cube.name, mimeType: '', buffer: Buffer.from(cube.bytes) });
    await listed(['red cube']);
    const { red } = await picture();
    await page.keyboard.press('o');
    await page.click('.models [aria-label^=Hide]');
    expect((await picture()).red).toBe(0);
    await page.keyboard.press('o');
    await page.click('.models [aria-label^=Show]');
    await page.click('.models .name');
    await page.fill('.field:has-text("Scale") input', '0.5');
    await page.keyboard.press('Enter');
    const smaller = await picture();
    expect(smaller.red / red).toBeGreaterThan(0.1);
    expect(smaller.red / red).toBeLessThan(0.5);
    await page.keyboard.press('o');
    await page.click('.models [aria-label^=Duplicate]');
    await listed(['red cube', 'red cube 2']);
    expect((await picture()).red).toBeGreaterThan(1.5 * smaller.red);
    await page.keyboard.press('o');
    await page.click('.models [aria-label^=Delete]');
    await page.click('.models [aria-label^=Delete]');
    await listed([]);
    expect((await picture()).red).toBe(0);
    expect(said).toEqual([]);
  });

  it('is selected by a click, and moved by its handles while the camera stays', async () => {
    await dropAt({ x: 420, y: 150 }, cube);
    await listed(['red cube']);
    const before = await picture();
    await page.mouse.click(420, 145);
    await page.waitForSelector('.models li.on');
    const places = () => page.$$eval('.models .three:nth-of-type(2) input', (all) => all.map((one) => (one as HTMLInputElement).valueAsNumber));
    const [x, y, z] = await places();
    await page.mouse.move(430, 150);
    await page.waitForTimeout(500);
    await page.mouse.move(440, 150);
    await page.mouse.down();
    await page.mouse.move(450, 150, { steps: 4 });
    await page.mouse.up();
    await page.waitForSelector('.models li.on');
    const [movedX, ...others] = await places();
    expect(movedX).toBeGreaterThan(x + 1);
    expect(others).toEqual([y, z]);
    const after = await picture();
    expect(after.red).toBeGreaterThan(0);
    const above = 3 * 480 * 60; // the rows above the model
    expect(after.pixels.subarray(0, above).filter((value, i) => Math.abs(value - before.pixels[i]) > 8).length).toBeLessThan(30);
    await page.mouse.click(460, 250);
    expect(await page.isVisible('.models li.on')).toBe(false);
    await page.keyboard.press('o');
    await page.click('.models .name');
    await page.click('.models button:text-is("Put on a place…")');
    await page.mouse.click(400, 200);
    await page.waitForSelector('.models button:text-is("Put on a place…")');
    const [putX] = await places();
    expect(putX).toBeLessThan(movedX - 1);
    await picture();
    await page.keyboard.press('o');
    await page.click('.models .name');
    await page.click('.models button:text-is("Put on a place…")');
    await page.mouse.click(400, 195); // at its own place
    await page.waitForSelector('.models button:text-is("Put on a place…")');
    expect(await places()).not.toEqual([putX, y, z]);
    expect(said).toEqual([]);
  });

  it('is named if it is broken, and the page keeps working', async () => {
    await drop({ name: 'x.glb', bytes: Buffer.from('garbage') });
    expect(await errorText()).toMatch(/x\.glb.*Is not a glTF file/);
    for (const kind of ['fbx', 'obj']) {
      await page.click('.error button');
      await drop({ name: `x.${kind}`, bytes: Buffer.from('garbage') });
      expect(await errorText()).toContain(`x.${kind}`);
    }
    await page.click('.error button');
    await drop({ name: 'world.json', bytes: Buffer.from('{"kind":"tessera world","version":1,"models":[{}]}') });
    expect(await errorText()).toContain('world.json, models[0].files');
    await page.click('.error button');
    await drop(cube);
    await listed(['red cube']);
    expect((await picture()).red).toBeGreaterThan(500);
    expect(said).toEqual([]);
  });

  it('has its true size and its textures, whatever program wrote it', async () => {
    const fbx = [
      '; FBX 7.3.0 project file', 'FBXHeaderExtension:  {', '\tFBXHeaderVersion: 1003', '\tFBXVersion: 7300', '}',
      'GlobalSettings:  {', '\tVersion: 1000', '\tProperties70:  {',
      '\t\tP: "UpAxis", "int", "Integer", "",1', '\t\tP: "UnitScaleFactor", "double", "Number", "",1', '\t}', '}',
      'Objects:  {',
      '\tGeometry: 1, "Geometry::tri", "Mesh" {', '\t\tVertices: *9 {', '\t\t\ta: 0,0,0,1000,0,0,0,2000,0', '\t\t}',
      '\t\tPolygonVertexIndex: *3 {', '\t\t\ta: 0,1,-3', '\t\t}', '\t}',
      '\tModel: 2, "Model::tri", "Mesh" {', '\t\tVersion: 232', '\t}', '}',
      'Connections:  {', '\tC: "OO",1,2', '\tC: "OO",2,0', '}', '',
    ].join('\n');
    await drop({ name: 'sign.fbx', bytes: Buffer.from(fbx) });
    await listed(['sign']);
    expect(await page.textContent('.models .details')).toContain('10.0 × 0.00 × 20.0 m');
    await page.click('.models [aria-label^=Delete]');

    const obj = 'mtllib paint.mtl\nusemtl red\nv -9 0 -9\nv 9 0 -9\nv -9 0 9\nv 9 9 9\nvt 0 0\nf 1/1 3/1 2/1\nf 2/1 3/1 4/1\n';
    const png = 'iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC';
    await drop(
      { name: 'roof.obj', bytes: Buffer.from(obj) }, { name: 'Red.PNG', bytes: Buffer.from(png, 'base64') },
      { name: 'paint.mtl', bytes: Buffer.from('newmtl red\nKd 1 1 1\nKe 1 0 0\nmap_Kd maps\\red.png\n') });
    await listed(['roof']);
    const { models } = JSON.parse(Buffer.from((await save('Save')).bytes).toString()) as { models: { files: string[] }[] };
    expect(models[0].files).toEqual(['roof.obj', 'paint.mtl', 'Red.PNG']);
    expect((await picture()).red).toBeGreaterThan(500);
    expect(await page.isVisible('.error')).toBe(false);
    expect(said).toEqual([]);
  });

  it('fetches nothing from the network', async () => {
    const change = (gltf: any) => (gltf.images = [{ uri: `${server.url}nothing.png` }]);
    await drop({ name: 'asks.glb', bytes: testGlb({ edge: 10, change }) });
    expect(await errorText()).toContain('nothing.png, and nothing is fetched');
    await page.click('.error button');
    const text = `mtllib a.mtl\nusemtl red\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n`;
    const mtl = `newmtl red\nKd 1 0 0\nmap_Kd ${server.url}nothing.png\n`;
    await drop({ name: 'a.obj', bytes: Buffer.from(text) }, { name: 'a.mtl', bytes: Buffer.from(mtl) });
    expect(await errorText()).toContain('nothing.png, and nothing is fetched');
    await page.click('.error button');
    await drop({ name: 'a.obj', bytes: Buffer.from(text) }, { name: 'a.mtl', bytes: Buffer.from(mtl.replace(server.url, '')) });
    expect(await errorText()).toMatch(/a\.obj.*Is shown without nothing\.png/);
    await listed(['a']);
    expect(asked.filter((url) => url.includes('nothing'))).toEqual([]);
    expect(said).toEqual([]);
  });
});
