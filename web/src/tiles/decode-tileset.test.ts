import { describe, expect, it } from 'vitest';
import { SceneError } from '../scene-error';
import { goldenText } from '../testing/golden';
import { randomNumbers } from '../testing/test-tree';
import { decodeTileset } from './decode-tileset';
import { isPlainUri } from './tileset-rules';
import { metresPerUnit } from './tileset';

const text = goldenText('tileset.json');

type Changeable = any;

function changed(change: (file: Changeable) => void): string {
  const file = JSON.parse(text) as Changeable;
  change(file);
  return JSON.stringify(file);
}

const ours = (object: Changeable): Changeable => object.extensions.TESSERA_scene;
const name = ours(JSON.parse(text)).representation as string;
const kKnown = { [name]: {} };

describe('decodeTileset', () => {
  it('reads the golden scene', () => {
    const tileset = decodeTileset(text, 'tileset.json', kKnown);
    expect(tileset.representation).toBe(name);
    expect([tileset.columns, tileset.rows, tileset.levels]).toEqual([2, 1, 2]);
    expect(tileset.tiles).toHaveLength(3);
    expect(tileset.tiles[0].children).toEqual([1, 2]);
    expect(tileset.tiles.map(({ parent }) => parent)).toEqual([-1, 0, 0]);
    const backgroundBlocks = tileset.tiles[0].contents.filter(({ backgroundBlock }) => backgroundBlock);
    expect(backgroundBlocks.map(({ level, geometricError }) => [level, geometricError])).toEqual([[0, 3.125], [1, 6.25]]);
    expect(tileset.georeference).toBeDefined();
    expect(metresPerUnit(tileset)).toBeGreaterThan(0);
  });

  it('ignores unknown fields', () => {
    expect(() => decodeTileset(changed((file) => {
      file.root.extras = { a: 1 };
      ours(file).later = [1];
    }), 'a', kKnown)).not.toThrow();
  });

  it.each<[string, (file: Changeable) => void]>([
    ['not 3D Tiles 1.1', (file) => (file.asset.version = '1.0')],
    ['requires extensions', (file) => (file.extensionsRequired = ['X'])],
    ['no extension TESSERA_scene', (file) => delete file.extensions],
    ['has version 2; only 1 is supported', (file) => (ours(file).version = 2)],
    ['no representation', (file) => (ours(file).representation = 'points')],
    ['lacks numbers', (file) => (ours(file).worldFromScene.scale = '1')],
    ["worldFromScene's rotation is not a rotation", (file) => (ours(file).worldFromScene.rotation[0] = 2)],
    ["worldFromScene's scale", (file) => (ours(file).worldFromScene.scale = -1)],
    ['sourceFromWorld is not affine', (file) => (ours(file).sourceFromWorld[15] = 2)],
    ['the georeference is not a place', (file) => (ours(file).georeference.latitude = 91)],
    ["the grid's box is not that of its cells", (file) => (ours(file).grid.low[0] = -3)],
    ["the grid's heights", (file) => (ours(file).grid.high[2] = 17)],
    ['the number of levels', (file) => (ours(file).levels = 65)],
    ['near is not between', (file) => (ours(file).near = -1)],
    ['the background is not a colour', (file) => (ours(file).background[1] = 1.5)],
    ['has no geometricError', (file) => delete file.geometricError],
    ["below its root's", (file) => (file.geometricError = 0)],
    ['has no root', (file) => delete file.root],
    ['tile 0: is not refined by REPLACE', (file) => (file.root.refine = 'ADD')],
    ['only the root may have a transform', (file) => (file.root.children[0].transform = [])],
    ['its level is not below', (file) => (ours(file.root).level = 9)],
    ['a child is not of a finer level', (file) => (ours(file.root.children[0]).level = 1)],
    ['its children do not cover its cells', (file) => file.root.children.pop()],
    ['its children do not lie on a grid', (file) => (ours(file.root.children[1]).cells = [0, 0, 2, 1])],
    ['the root does not cover all cells', (file) => (ours(file.root).cells = [0, 0, 1, 1])],
    ['its box is not within its cells', (file) => (ours(file.root.children[0]).high[0] = 0.5)],
    ["a child's box is not within its own", (file) => (ours(file.root.children[0]).low[2] = -5)],
    ["a child's geometric error", (file) => (file.root.children[0].geometricError = file.root.geometricError * 2)],
    ["a content's uri", (file) => (file.root.children[0].content.uri = '../a.glb')],
    ["a content's uri", (file) => (file.root.children[0].content.uri = 'http://x/a.glb')],
    ["a content's box is not within", (file) => (ours(file.root.children[0].content).high[2] = 5)],
    ['a background block is not in the root', (file) => (ours(file.root.children[0].content).background_block = true)],
    ['the key surround is called background_block now', (file) => (ours(file.root.children[0].content).surround = true)],
    ['two background blocks have the same level', (file) => (ours(file.root.contents[2]).level = 0)],
    ["a background block's level is not below", (file) => (ours(file.root.contents[2]).level = 2)],
    ["a background block's level or geometric error is not valid", (file) => (ours(file.root.contents[2]).level = -1)],
    ["a background block's level or geometric error is not valid", (file) => (ours(file.root.contents[2]).geometricError = 'large')],
    ["a background block's geometric error is not a length", (file) => (ours(file.root.contents[2]).geometricError = -1)],
    ["a background block's geometric error is below a finer one's", (file) => (ours(file.root.contents[2]).geometricError = 1)],
    ['has both content and contents', (file) => (file.root.children[0].contents = [])],
    ['its boundingVolume is not its box', (file) => (file.root.boundingVolume.box[0] += 10)],
    ['a shared resource that is not listed', (file) => (ours(file.root.children[0].content).resources = [0])],
  ])('rejects with a reason: %s', (reason, change) => {
    expect(() => decodeTileset(changed(change), 'folder/tileset.json', kKnown)).toThrow(SceneError);
    expect(() => decodeTileset(changed(change), 'folder/tileset.json', kKnown)).toThrow(reason);
    expect(() => decodeTileset(changed(change), 'folder/tileset.json', kKnown)).toThrow('folder/tileset.json');
  });

  it('names an unknown representation, and the known ones', () => {
    const other = changed((file) => (ours(file).representation = 'points'));
    expect(() => decodeTileset(other, 'a', { lines: {}, planes: {} })).toThrow('a scene of points, not of lines or planes');
    expect(decodeTileset(other, 'a', { points: {} }).representation).toBe('points');
  });

  it('allows contents of a tile to overlap only if the representation does', () => {
    const overlapping = changed(({ root: { children: [child] } }) => {
      child.contents = [child.content, { ...child.content, uri: 'b.glb' }];
      delete child.content;
    });
    expect(() => decodeTileset(overlapping, 'a', kKnown)).toThrow('contents of a tile have no order');
    expect(() => decodeTileset(overlapping, 'a', { [name]: { overlappingContents: true } })).not.toThrow();
  });

  it('rejects tilesets that exceed the limits', () => {
    const limits = { textLength: 1e6, tiles: 9, depth: 9, contentsOfTile: 9, resources: 9 };
    expect(() => decodeTileset(text, 'a', kKnown, limits)).not.toThrow();
    expect(() => decodeTileset(text, 'a', kKnown, { ...limits, textLength: 100 })).toThrow('larger than any tileset');
    expect(() => decodeTileset(text, 'a', kKnown, { ...limits, tiles: 2 })).toThrow('too many tiles');
    expect(() => decodeTileset(text, 'a', kKnown, { ...limits, depth: 1 })).toThrow('too deep');
    expect(() => decodeTileset(text, 'a', kKnown, { ...limits, contentsOfTile: 1 })).toThrow('too many contents');
  });

  it('either reads mutated text or names what is wrong', () => {
    const random = randomNumbers(5);
    for (let round = 0; round < 3000; ++round) {
      const letters = [...text];
      for (let i = 0; i <= random() * 3; ++i) {
        letters[Math.floor(random() * letters.length)] = String.fromCharCode(32 + Math.floor(random() * 95));
      }
      try {
        decodeTileset(letters.join(''), 'a', kKnown);
      } catch (error) {
        expect(error).toBeInstanceOf(SceneError);
      }
    }
  });
});

describe('a plain uri', () => {
  it('stays in its folder and needs no escaping', () => {
    for (const uri of ['a.glb', 'tiles/L0/a-0f_1.glb']) expect(isPlainUri(uri)).toBe(true);
    for (const uri of ['', '/a', 'a/', 'a//b', '../a', 'a/../b', '.a', 'a/.b', 'a b', 'a%20b', 'a?b', 'ä', 'a:b', 'a'.repeat(256)]) {
      expect(isPlainUri(uri)).toBe(false);
    }
  });
});
