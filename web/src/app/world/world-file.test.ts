import { describe, expect, it } from 'vitest';
import { SceneError } from '../../scene-error';
import { decodeWorld, encodeWorld, savedWorld, type World } from './world-file';

const world: Omit<World, 'files'> = {
  scenes: [
    { name: 'harbour', url: 'https://a/harbour/', place: { position: [100, 0, 1], rotation: [0, 0, 0, 1], scale: 0.5 }, visible: false },
    { name: 'city', url: 'city.scene/tileset.json', visible: true },
  ],
  models: [
    { name: 'car', files: ['car/car.gltf', 'car/car.bin'], contents: ['3-0a', '4-0b'], position: [1.5, -2, 3e-3], rotation: [0, 0, 0, 1], scale: [1, 2, 3], visible: true, plays: false },
    { name: 'tree, "[a,  b]\\', files: ['tree.glb'], contents: [], position: [0, 0, 0], rotation: [0.5, -0.5, 0.5, 0.5], scale: [0.1, 0.1, 0.1], visible: false, plays: true },
  ],
  hidden: [{ name: 'Part 1', middle: [1, 2, 3], size: [4, 5, 6], turn: 0.5, hides: true }],
  bookmarks: [{ name: 'Square', view: 'eye=1,2,3&target=0,0,0&fov=50' }],
};
const text = encodeWorld(world, new Map([['tree.glb', btoa('abc')], ['__proto__', btoa('x')]]));

function said(change: (file: any) => void): string {
  const file = JSON.parse(text) as any;
  change(file);
  return decodeError(JSON.stringify(file));
}

function decodeError(lying: string): string {
  try {
    decodeWorld(lying, 'world.json');
  } catch (error) {
    if (error instanceof SceneError) return error.message;
    throw error;
  }
  return '';
}

describe('decodeWorld', () => {
  it('reads what was written', () => {
    const { files, ...rest } = decodeWorld(text, 'world.json');
    expect(rest).toEqual(world);
    expect([...files]).toEqual([['tree.glb', new TextEncoder().encode('abc')], ['__proto__', new TextEncoder().encode('x')]]);
    expect(decodeWorld(encodeWorld(world, new Map()), 'world.json')).toEqual({ ...world, files: new Map() });
    expect(text).toContain('"position":[1.5,-2,0.003]');
  });

  it('ignores unknown fields, and requires only scenes', () => {
    expect(said((file) => (file.later = [{}]))).toBe('');
    const file = JSON.parse(text);
    delete file.models[1].visible;
    delete file.models[0].plays;
    expect(decodeWorld(JSON.stringify(file), 'a').models).toMatchObject([{ plays: true }, { visible: true }]);
    expect(decodeWorld('{"kind":"tessera world","version":2,"scenes":[{"url":"a"}]}', 'a')).toEqual({
      scenes: [{ name: '', url: 'a', visible: true }], models: [], hidden: [], bookmarks: [], files: new Map(),
    });
  });

  it('reads version 1, which has one scene', () => {
    const [{ contents, plays, ...model }] = world.models;
    const read = (url: string) => decodeWorld(JSON.stringify({ kind: 'tessera world', version: 1, scene: { name: 'city', url }, models: [model] }), 'a');
    expect(read('http://a/tileset.json')).toEqual({
      scenes: [{ name: 'city', url: 'http://a/tileset.json', visible: true }],
      models: [{ ...model, contents: [], plays: true }], hidden: [], bookmarks: [], files: new Map(),
    });
    expect(read('javascript:alert(1)').scenes[0].url).toBe('');
  });

  it('accepts only http, https and relative addresses', () => {
    for (const url of ['a', '../a/', '/a', '//b/a', 'HTTPS://b/a', '?a']) expect(said((file) => (file.scenes[0].url = url))).toBe('');
    for (const url of ['javascript:alert(1)', 'data:,a', 'file:///a', 'blob:http://a/b', ' ftp://a', 'http://', 'x'.repeat(1001)]) {
      expect(said((file) => (file.scenes[0].url = url))).toBe('world.json: scenes[0].url: is neither an address of http or https nor a relative one; correct it, or save it again');
    }
    for (const name of ['javascript:alert(1)', 'data:,a', '//b/a.glb', '\\\\b\\a.glb', 'http://']) {
      expect(said((file) => (file.models[0].files[1] = name))).toContain('models[0].files: has an invalid name');
    }
    for (const name of ['a b#c?d.glb', '../a.glb', 'https://b/a.glb', 'C:a.glb']) expect(said((file) => (file.models[0].files[1] = name))).toBe('');
  });

  it("requires one scene that defines the world's frame", () => {
    expect(said((file) => file.scenes.pop())).toContain('scenes: contains no scene without a placement, which would define the frame of the world; leave out position');
    expect(said((file) => (file.scenes = []))).toContain('scenes: contains no scene without a placement');
    expect(said((file) => delete file.scenes)).toContain('scenes: is not a list');
    expect(said((file) => (file.scenes = Array.from({ length: 17 }, () => file.scenes[1])))).toContain('scenes: are more than 16');
    for (const none of [5, null, 'a', [], [{ url: 'a' }]]) expect(said((file) => file.scenes.push(none))).toContain('scenes[2]: is not an object');
    expect(said((file) => (file.scenes[0].scale = [1, 1, 1]))).toContain('scenes[0].scale: is not a number');
    expect(said((file) => (file.scenes[0].scale = 0))).toContain('scenes[0].scale: is not above 0.000001');
    expect(said((file) => (file.scenes[0].rotation = [1, 1, 1, 1]))).toContain('scenes[0].rotation: is not a rotation');
    expect(said((file) => (file.scenes[0].position = [1, null, 1]))).toContain('scenes[0].position: is not 3 numbers');
  });

  it('validates hidden parts and views', () => {
    expect(said((file) => (file.hidden = Array.from({ length: 9 }, () => file.hidden[0])))).toContain('hidden: are more than 8');
    expect(said((file) => (file.hidden[0].size = [1, 0, 1]))).toContain('hidden[0].size: is not above');
    expect(said((file) => (file.hidden[0].middle = [1, 1e9, 1]))).toContain('hidden[0].middle: has a number beyond');
    expect(said((file) => (file.hidden[0].turn = '1'))).toContain('hidden[0].turn: is not a number');
    expect(said((file) => delete file.hidden[0].name)).toContain('hidden[0].name: is missing');
    expect(said((file) => (file.bookmarks[0].view = 'eye=1,2,3'))).toContain('bookmarks[0].view: is not a view');
    expect(said((file) => (file.bookmarks = Array.from({ length: 201 }, () => file.bookmarks[0])))).toContain('bookmarks: are more than 200');
  });

  it('names the file and the place of what is wrong', () => {
    expect(decodeError('{')).toMatch(/^world.json: is not JSON: .*; correct it, or save it again$/);
    for (const other of ['null', '[]', '3', '{"version":1,"models":[]}']) expect(decodeError(other)).toContain('is not a world of this viewer');
    expect(said((file) => (file.version = 3))).toContain('world.json: version: is neither 1 nor 2; open it with a newer viewer');
    expect(said((file) => (file.models = {}))).toContain('models: is not a list');
    expect(said((file) => (file.models[0].contents = [3]))).toContain('models[0].contents');
    expect(said((file) => (file.models = Array.from({ length: 1001 }, () => file.models[0])))).toContain('models: are more than 1000');
    expect(said((file) => (file.models[1] = null))).toContain('models[1].files: names no files');
    expect(said((file) => (file.models[0].files = [3]))).toContain('models[0].files: has an invalid name');
    expect(said((file) => (file.models[0].name = 'x'.repeat(1001)))).toContain('models[0].name');
  });

  it('rejects numbers that give no valid placement', () => {
    for (const lie of [[1, 2], 'abc', [1, 2, null], [1, 2, '3'], [1e8, 0, 0]]) {
      expect(said((file) => (file.models[0].position = lie))).toContain('models[0].position');
    }
    expect(decodeError(text.replace('0.003', '1e999'))).toContain('models[0].position: is not 3 numbers');
    for (const lie of [[0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 0, 1e300], [0, 0, 1]]) {
      expect(said((file) => (file.models[0].rotation = lie))).toContain('models[0].rotation');
    }
    for (const lie of [[0, 1, 1], [1, -1, 1], [1, 1, 1e7]]) {
      expect(said((file) => (file.models[0].scale = lie))).toContain('models[0].scale');
    }
  });

  it('names an invalid embedded file', () => {
    expect(said((file) => (file.files['tree.glb'] = '*'))).toContain('files["tree.glb"]: is not base64');
    expect(said((file) => (file.files['tree.glb'] = 5))).toContain('files["tree.glb"]: is not text');
    expect(said((file) => (file.files = ['a']))).toContain('files: is not an object');
  });
});

describe('savedWorld', () => {
  it('accepts only worlds that can be opened again', async () => {
    expect(await savedWorld(world, new Map([['tree.glb', btoa('abc')], ['__proto__', btoa('x')]])).text()).toBe(text);
    const change = (one: Partial<World>, files = new Map<string, string>()) => () => savedWorld({ ...world, ...one }, files);
    expect(change({ hidden: [{ ...world.hidden[0], size: [1, 2e6, 1] }] })).toThrow('world.json: hidden[0].size: has a number beyond');
    expect(change({ models: [{ ...world.models[0], name: '' }] })).toThrow('models[0].name: is missing, or too long, so that it could not be opened again; change that');
    expect(change({}, new Map(Array.from({ length: 4001 }, (_, i) => [String(i), ''])))).toThrow('is one file too many');
    expect(change({}, new Map([['a', 'A'.repeat(1.4 * 128e6)]]))).toThrow('would be larger than 179.2 MB; save it without its models');
  });
});
