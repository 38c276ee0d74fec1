import { describe, expect, it } from 'vitest';
import { SceneError } from '../../scene-error';
import { testGlb } from '../../testing/test-glb';
import { checkGltf } from './gltf-check';
import type { ModelFile } from './model-files';

const main: ModelFile = { path: 'in/x.glb', file: new Blob() };
const cube = (change?: (gltf: any) => void) => testGlb({ edge: 1, change });
const said = (bytes: Uint8Array, files: ModelFile[] = [main]): string => {
  try {
    checkGltf(bytes, main, files);
  } catch (error) {
    if (error instanceof SceneError) return error.message;
    throw error;
  }
  return '';
};

describe('checkGltf', () => {
  it('accepts a plain file', () => {
    expect(checkGltf(cube(), main, [main])).toEqual({ needsMeshopt: false });
    expect(checkGltf(cube((gltf) => gltf.extensionsUsed.push('EXT_meshopt_compression')), main, [main]).needsMeshopt).toBe(true);
  });

  it('names what is wrong', () => {
    expect(said(new TextEncoder().encode('garbage'))).toBe('x.glb: is not a glTF file; export it again');
    expect(said(cube().subarray(0, 100))).toContain('x.glb: is cut off');
    expect(said(cube((gltf) => (gltf.asset.version = '1.0')))).toContain('is not glTF 2.0');
    expect(said(new TextEncoder().encode('null'))).toContain('is not glTF 2.0');
  });

  it('rejects files that refer to the network', () => {
    expect(said(cube((gltf) => (gltf.images = [{ uri: 'https://example.com/a.png' }])))).toContain('images[0]: asks for https://example.com/a.png');
    expect(said(cube((gltf) => (gltf.buffers[0].uri = '//example.com/a.bin')))).toContain('buffers[0]: asks for //example.com/a.bin');
  });

  it('names a missing buffer', () => {
    const bytes = cube((gltf) => (gltf.buffers[0].uri = 'a.bin'));
    expect(said(bytes)).toContain('buffers[0]: needs a.bin');
    expect(said(bytes, [main, { path: 'in/a.bin', file: new Blob() }])).toBe('');
  });

  it('names an unsupported compression', () => {
    expect(said(cube((gltf) => gltf.extensionsUsed.push('KHR_draco_mesh_compression')))).toContain('export it without Draco compression');
    const basis = (key: string) => cube((gltf) => (gltf[key] = ['KHR_texture_basisu']));
    expect(said(basis('extensionsRequired'))).toContain('PNG, JPEG or WebP');
    expect(said(basis('extensionsUsed'))).toBe('');
  });

  it('rejects cyclic trees and accessors without data', () => {
    expect(said(cube((gltf) => (gltf.nodes[0].children = [0])))).toContain('is its own ancestor');
    expect(said(cube((gltf) => (gltf.nodes = [{ children: [1] }, { children: [2] }, { children: [1] }])))).toContain('is its own ancestor');
    expect(said(cube((gltf) => (gltf.nodes = [{ children: [1] }, { children: [2] }, {}])))).toBe('');
    expect(said(cube((gltf) => gltf.accessors.push({ componentType: 5126, count: 4e9, type: 'MAT4' })))).toContain('claims more');
  });
});
