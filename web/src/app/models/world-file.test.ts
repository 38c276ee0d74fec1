import { describe, expect, it } from 'vitest';
import { SceneError } from '../../scene-error';
import { decodeWorld, encodeWorld, type World } from './world-file';

const world: Omit<World, 'files'> = {
  scene: { name: 'city', url: 'http://a/scene/tileset.json' },
  models: [
    { name: 'car', files: ['car/car.gltf', 'car/car.bin'], position: [1.5, -2, 3e-3], rotation: [0, 0, 0, 1], scale: [1, 2, 3], visible: true },
    { name: 'tree, "[a,  b]\\', files: ['tree.glb'], position: [0, 0, 0], rotation: [0.5, -0.5, 0.5, 0.5], scale: [0.1, 0.1, 0.1], visible: false },
  ],
};
const text = encodeWorld(world, new Map([['tree.glb', btoa('abc')], ['__proto__', btoa('x')]]));

function said(change: (file: any) => void): string {
  const file = JSON.parse(text) as any;
  change(file);
  return saidOf(JSON.stringify(file));
}

function saidOf(lying: string): string {
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

  it('passes over what it does not know, and takes models to be visible', () => {
    expect(said((file) => (file.later = [{}]))).toBe('');
    const file = JSON.parse(text);
    delete file.models[1].visible;
    expect(decodeWorld(JSON.stringify(file), 'a').models[1].visible).toBe(true);
  });

  it('names the file and the place of what is wrong', () => {
    expect(saidOf('{')).toBe('world.json: is not JSON; save it again');
    for (const other of ['null', '[]', '3', '{"version":1,"models":[]}']) expect(saidOf(other)).toContain('is no world of this viewer');
    expect(said((file) => (file.version = 2))).toContain('world.json: version: is not 1');
    expect(said((file) => delete file.models)).toContain('models: is no list');
    expect(said((file) => (file.models = Array.from({ length: 1001 }, () => file.models[0])))).toContain('models: are more than 1000');
    expect(said((file) => (file.models[1] = null))).toContain('models[1].files: names no files');
    expect(said((file) => (file.models[0].files = [3]))).toContain('models[0].files: has a name that is none');
    expect(said((file) => (file.models[0].name = 'x'.repeat(1001)))).toContain('models[0].name');
  });

  it('lets no number through that places nothing', () => {
    for (const lie of [[1, 2], 'abc', [1, 2, null], [1, 2, '3'], [1e8, 0, 0]]) {
      expect(said((file) => (file.models[0].position = lie))).toContain('models[0].position');
    }
    expect(saidOf(text.replace('0.003', '1e999'))).toContain('models[0].position: is not 3 numbers');
    for (const lie of [[0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 0, 1e300], [0, 0, 1]]) {
      expect(said((file) => (file.models[0].rotation = lie))).toContain('models[0].rotation');
    }
    for (const lie of [[0, 1, 1], [1, -1, 1], [1, 1, 1e7]]) {
      expect(said((file) => (file.models[0].scale = lie))).toContain('models[0].scale');
    }
  });

  it('names a file in it that is none', () => {
    expect(said((file) => (file.files['tree.glb'] = '*'))).toContain('files["tree.glb"]: is no base64');
    expect(said((file) => (file.files['tree.glb'] = 5))).toContain('files["tree.glb"]: is no text');
    expect(said((file) => (file.files = ['a']))).toContain('files: is no object');
  });
});
