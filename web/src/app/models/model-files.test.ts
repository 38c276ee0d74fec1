import { describe, expect, it } from 'vitest';
import { findFile, isModel, isOfNetwork, fileExtension } from './model-files';

const files = ['car/car.gltf', 'car/car.bin', 'car/maps/Paint 1.png', 'other/car.bin'].map((path) => ({ path, file: new Blob() }));

describe('findFile', () => {
  it('resolves names relative to the referencing file', () => {
    expect(findFile('car.bin', 'car/car.gltf', files)?.path).toBe('car/car.bin');
    expect(findFile('./car.bin', 'other/x.gltf', files)?.path).toBe('other/car.bin');
    expect(findFile('../car/car.bin', 'other/x.gltf', files)?.path).toBe('car/car.bin');
  });

  it('finds a name in any folder, with any path separators', () => {
    expect(findFile('C:\\work\\maps\\paint 1.PNG', 'car/car.gltf', files)?.path).toBe('car/maps/Paint 1.png');
    expect(findFile('Paint%201.png', 'car/car.gltf', files)?.path).toBe('car/maps/Paint 1.png');
    expect(findFile('100%.png', 'car/car.gltf', files)).toBeUndefined();
    expect(findFile('', 'car/car.gltf', files)).toBeUndefined();
  });
});

it('recognises models', () => {
  expect(files.filter(isModel).map(({ path }) => path)).toEqual(['car/car.gltf']);
  expect([fileExtension('a.b/C.GLB'), fileExtension('a.b/c')]).toEqual(['glb', '']);
});

it('recognises network addresses', () => {
  for (const uri of ['http://a/b', 'HTTPS://a', '//a/b', ' https:a', '\\\\a\\b', 'ws://a']) expect(isOfNetwork(uri)).toBe(true);
  for (const uri of ['a.png', 'data:image/png;base64,AA', 'blob:http://a/b', 'C:\\a', '/a/b', 'http.png']) expect(isOfNetwork(uri)).toBe(false);
});
