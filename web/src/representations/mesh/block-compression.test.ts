import { describe, expect, it } from 'vitest';
import { decodeTexture } from './block-compression';

// Returns the 16 texels of a block with these end points, whose texel n has the index n mod 8.
function decodeOne(e0: number, e1: number): number[] {
  let bits = 0n;
  for (let texel = 15; texel >= 0; --texel) bits = (bits << 3n) | BigInt(texel % 8);
  const block = new Uint8Array(8);
  block.set([e0, e1]);
  for (let i = 0; i < 6; ++i) block[2 + i] = Number((bits >> BigInt(8 * i)) & 255n);
  const texels = new Uint8Array(16);
  decodeTexture(block, 4, 4, 1, texels, 0, 1);
  return [...texels];
}

describe('decodeTexture', () => {
  it('mixes six colours between descending end points', () => {
    const palette = [210, 0, 180, 150, 120, 90, 60, 30];
    expect(decodeOne(210, 0)).toEqual([...palette, ...palette]);
  });

  it('mixes four colours between ascending end points, beside 0 and 255', () => {
    const palette = [50, 200, 80, 110, 140, 170, 0, 255];
    expect(decodeOne(50, 200)).toEqual([...palette, ...palette]);
    expect(decodeOne(7, 7).slice(0, 8)).toEqual([7, 7, 7, 7, 7, 7, 0, 255]);
  });

  it('puts blocks and channels in their places', () => {
    // 8 × 4 texels of two channels: each block is uniform.
    const blocks = new Uint8Array([10, 20, 30, 40].flatMap((value) => [value, value, 0, 0, 0, 0, 0, 0]));
    const texels = new Uint8Array(4 * 8 * 4);
    decodeTexture(blocks, 8, 4, 2, texels, 2, 4);
    for (let i = 0; i < 32; ++i) expect([...texels.subarray(4 * i, 4 * i + 4)]).toEqual(i % 8 < 4 ? [0, 0, 10, 20] : [0, 0, 30, 40]);
  });
});
