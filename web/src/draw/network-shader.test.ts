import { describe, expect, it } from 'vitest';
import { networkVectors, packNetwork } from '../tiles/network';
import { layersShader, writtenVector } from './network-shader';

describe('the network as GLSL', () => {
  it('writes its numbers as floats that round-trip', () => {
    const numbers = new Float32Array([1, -0.1, 1e-30, 3.4028234663852886e38, 0, 123456789, 0.3, -7]);
    const literals = [0, 1].flatMap((n) => [...writtenVector(numbers, n).matchAll(/-?\d+(\.\d+)?(e[+-]\d+)?/g)].slice(1));
    expect(literals.map(([text]) => Math.fround(Number(text)))).toEqual([...numbers]);
    for (const [text] of literals) expect(text).toMatch(/[.e]/); // GLSL accepts no integer literal for a float
  });

  it('reads each of its vectors once, in order', () => {
    const layer = (inputs: number, outputs: number) =>
      ({ inputs, outputs, weights: new Float32Array(inputs * outputs), biases: new Float32Array(outputs) });
    const network = [layer(34, 16), layer(16, 3)];
    const asked: number[] = [];
    layersShader([...new Array(34).keys()].map(String), network, (n) => `v${asked.push(n)}`);
    expect(asked).toEqual([...new Array(packNetwork(network).length / 4).keys()]);
    expect(networkVectors(network)).toBe(asked.length);
  });
});
