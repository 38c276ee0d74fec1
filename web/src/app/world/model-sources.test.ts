import { describe, expect, it } from 'vitest';
import { computeContentId } from './file-content';
import { fileOfContent, modelKey, assignFileNames } from './model-sources';

const file = (path: string, text: string) => ({ path, file: new Blob([text]) });

describe('files of models', () => {
  it('of one name get distinct names in a world', async () => {
    const [a, b, c] = [file('car.gltf', 'a'), file('Car.gltf', 'b'), file('car.gltf', 'c')];
    const shared = file('wheel.bin', 'w');
    const names = await assignFileNames(new Set([{ files: [a, shared] }, { files: [b, shared] }, { files: [c] }]));
    expect([...names.values()]).toEqual(['car.gltf', 'wheel.bin', '2/Car.gltf', '3/car.gltf']);
  });

  it("do not take the names of missing models' files", async () => {
    const [car, wheel] = [file('car.gltf', 'a'), file('wheel.bin', 'w')];
    const named = async (files: string[], contents: string[]) => [...(await assignFileNames(new Set([{ files: [car, wheel] }]), [{ files, contents }])).values()];
    expect(await named(['Car.gltf'], ['1-0'])).toEqual(['2/car.gltf', '2/wheel.bin']);
    expect(await named(['car.gltf'], [])).toEqual(['2/car.gltf', '2/wheel.bin']);
    expect(await named(['bus.gltf', 'wheel.bin'], ['1-0', '1-0'])).toEqual(['2/car.gltf', '2/wheel.bin']);
    // It is the same file, or one that both models use.
    expect(await named(['bus.gltf', 'wheel.bin'], ['1-0', await computeContentId(wheel.file)])).toEqual(['car.gltf', 'wheel.bin']);
    expect(await named(['bus.gltf', 'wheel.bin'], [])).toEqual(['car.gltf', 'wheel.bin']);
  });

  it('of one name with different content belong to another model', () => {
    const keys = [['a', 'b'], ['a\nb']].flatMap((files) => [[], ['1-0'], ['1-1']].map((contents) => modelKey({ files, contents })));
    expect(new Set(keys).size).toBe(6);
    expect(modelKey({ files: ['a', 'b'], contents: ['1-0'] })).toBe(keys[1]);
  });

  it('of one name are distinguished by their content', async () => {
    const all = [file('car.glb', 'red'), file('car.glb', 'two'), file('a.png', 'two')];
    for (const one of all.slice(0, 2)) expect(await fileOfContent('3/car.glb', await computeContentId(one.file), true, all)).toBe(one);
    expect(await fileOfContent('car.glb', '3-0', true, all)).toBe(all[0]); // the file has changed since
    expect(await fileOfContent('car.glb', undefined, true, all)).toBe(all[0]);
    expect(await fileOfContent('bus.glb', await computeContentId(all[0].file), true, all)).toBeUndefined();
    expect(await fileOfContent('a.png', await computeContentId(all[2].file), true, all)).toBeUndefined();
  });

  it('have digests that depend on each byte', async () => {
    const digests = await Promise.all(['', 'a', 'b', 'ab', 'ba', 'aa'].map((text) => computeContentId(new Blob([text]))));
    expect(new Set(digests).size).toBe(6);
    expect(await computeContentId(new Blob(['ab']))).toBe(digests[3]);
  });
});
