// Tests malformed tiles in the real viewer: the panel names what is wrong, and the page keeps working.
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { goldenFile, goldenText } from '../src/testing/golden';
import { randomNumbers } from '../src/testing/test-tree';
import { kCodecs } from '../src/representations/codecs';
import { decodeTileset } from '../src/tiles/decode-tileset';
import { goldenMesh, goldenScene, launch, missing, serve, type Server } from './machine';

type Change = (json: any, binary: Buffer) => void;

// Returns a binary glTF file with its JSON or its binary chunk changed.
function changedContent(file: Uint8Array, change: Change): Buffer {
  const given = Buffer.from(file);
  const jsonLength = given.readUInt32LE(12);
  const json = JSON.parse(given.toString('utf8', 20, 20 + jsonLength)) as object;
  const binary = Buffer.from(given.subarray(28 + jsonLength));
  change(json, binary);
  // Numbers that JSON cannot represent, as malformed files contain them.
  let text = JSON.stringify(json).replaceAll('"-1e999"', '-1e999').replaceAll('"1e999"', '1e999');
  while (Buffer.byteLength(text) % 4 !== 0) text += ' ';
  const header = Buffer.alloc(20);
  header.write('glTF');
  header.writeUInt32LE(2, 4);
  header.writeUInt32LE(28 + Buffer.byteLength(text) + binary.length, 8);
  header.writeUInt32LE(Buffer.byteLength(text), 12);
  header.write('JSON', 16);
  const chunk = Buffer.alloc(8);
  chunk.writeUInt32LE(binary.length, 0);
  chunk.write('BIN\0', 4);
  return Buffer.concat([header, Buffer.from(text), chunk, binary]);
}

const ours = (json: any) => json.extensions.TESSERA_content;
const part = (json: any) => ours(json).parts[0];
const getBufferView = (json: any, reference: any) => json.bufferViews[reference.bufferView];

const kContentLies: [string, string, Change][] = [
  ['an offset behind the end', 'buffer', (json) => (getBufferView(json, part(json).occupied).byteOffset = 2 ** 30)],
  ['a length that is negative', 'buffer', (json) => (getBufferView(json, part(json).occupied).byteLength = -4)],
  ['a size that pictures do not have', 'part 0', (json) => (part(json).planes = 256)],
  ['a size beyond all', 'part 0', (json) => (part(json).voxels = 1e9)],
  ['pictures of other sizes', 'part 0', (json) => (part(json).planeTexels[0][0] = part(json).macroblocks.texels[0])],
  ['more macroblocks than there are', 'part 0', (json) => (part(json).macroblocks.stored = 4e9)],
  ['a range that is infinite', 'ange', (json) => (ours(json).featureRange = '1e999')],
  ['a place that is none', 'part 0', (json) => (part(json).centre[0] = '-1e999')],
  ['weights that are no numbers', 'network', (json, binary) =>
    binary.writeFloatLE(NaN, (getBufferView(json, ours(json).network).byteOffset as number) + 40)],
];

// The same of a content of `mesh`.
const kMeshLies: [string, string, Change][] = [
  ['an offset behind the end', 'buffer', (json) => (getBufferView(json, part(json).vertices).byteOffset = 2 ** 30)],
  ['patches beyond all', 'patches', (json) => (part(json).patches = 4e9)],
  ['more patches than it has', 'vertices', (json) => (part(json).patches += 2)],
  ['patches of a size that is none', 'patch_edge', (json) => (part(json).patch_edge = 6)],
  ['textures of another size', 'features', (json) => (part(json).features[2] = part(json).vertices)],
  ['a range that is infinite', 'ranges', (json) => (part(json).ranges[3][1] = '1e999')],
  ['a place that is none', 'origin', (json) => (part(json).origin[0] = '-1e999')],
  ['a background block that is none', 'background', (json) => (ours(json).background_block = true)],
  ['a network that cannot be', 'network', (json) => (part(json).network.layers[0] = [17, 1e6])],
];

const kTilesetLies: [string, string, (text: string) => string][] = [
  ['a tree as deep as it likes', 'too deep', (text) => {
    const json = JSON.parse(text) as any;
    let tile = json.root.children[0];
    for (let i = 0; i < 500; ++i) tile = (tile.children = [structuredClone({ ...tile, children: undefined })])[0];
    return JSON.stringify(json);
  }],
  ['no JSON', 'tileset.json', (text) => text.slice(0, -100)],
  ['nested brackets without end', 'tileset.json', () => '['.repeat(1e6)],
  ['an error that is infinite', 'geometricError', (text) => text.replace(/"geometricError":\s*[\d.]+/, '"geometricError": 1e999')],
];

describe.skipIf(missing()).each([
  { representation: 'volume', folder: goldenScene, lies: kContentLies },
  { representation: 'mesh', folder: goldenMesh, lies: kMeshLies },
] as const)('a malformed scene of $representation', ({ representation, folder, lies }) => {
  let server: Server;
  let browser: Browser;
  let page: Page;
  const thrown: string[] = [];
  let change: { file: RegExp; body: Buffer } | undefined;
  const tileset = decodeTileset(goldenText('tileset.json', representation), 'tileset.json', kCodecs);
  const uri = tileset.tiles[1].contents[0].uri;

  beforeAll(async () => {
    [server, browser] = await Promise.all([serve(folder), launch()]);
    page = await browser.newPage({ viewport: { width: 320, height: 180 } });
    page.on('pageerror', (error) => thrown.push(error.message));
    await page.route(/\/scene\//, (route) =>
      change?.file.test(route.request().url()) ? route.fulfill({ body: change.body }) : route.continue());
  });
  afterAll(async () => {
    await browser?.close();
    server?.close();
  });

  // Returns the text of the panel once the page has come to rest; '' if nothing is wrong.
  async function visit(file: RegExp, body: Buffer): Promise<string> {
    change = { file, body };
    await page.goto(server.url);
    await page.waitForSelector('.loading.done', { state: 'attached' });
    const text = (await page.isVisible('.error')) ? await page.textContent('.error') : '';
    expect(await page.evaluate(() => 6 * 7)).toBe(42); // the page still responds
    expect(thrown).toEqual([]);
    return text ?? '';
  }

  it.each([...lies])('is reported: %s', async (_, reason, lie) => {
    const said = await visit(new RegExp(uri), changedContent(goldenFile(uri, representation), lie));
    expect(said).toContain(uri);
    expect(said.toLowerCase()).toContain(reason.toLowerCase());
  });

  it.each(kTilesetLies)('is reported: %s', async (_, reason, lie) => {
    const said = await visit(/tileset\.json/, Buffer.from(lie(goldenText('tileset.json', representation))));
    expect(said).toContain('tileset.json');
    expect(said).toContain(reason);
  });

  it('is drawn or reported, whichever bytes of a tile are changed', async () => {
    const random = randomNumbers(17);
    for (let round = 0; round < 4; ++round) {
      const body = Buffer.from(goldenFile(uri, representation));
      for (let i = 0; i < 1 + 4 * round; ++i) body[Math.floor(random() * body.length)] = Math.floor(random() * 256);
      const said = await visit(new RegExp(uri), body);
      if (said !== '') expect(said).toContain(uri);
    }
  });
});
