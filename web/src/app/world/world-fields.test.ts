import { describe, expect, it } from 'vitest';
import { scaledWithin, readScales, scaleWithin } from './world-fields';

const fail = (place: string, reason: string): never => {
  throw new Error(`${place} ${reason}`);
};

describe('scales of a world', () => {
  it('are clamped to the valid range', () => {
    expect([1e9, 5, 0, -1].map(scaleWithin)).toEqual([1e6, 5, 1e-6, 1e-6]);
  });

  it('keep their proportions', () => {
    expect(scaledWithin([1, 2, 4], 3)).toEqual([3, 6, 12]);
    expect(scaledWithin([1, 2, 4], 1e7)).toEqual([25e4, 5e5, 1e6]);
    for (const factor of [1e30, 1e-30]) {
      const scales = scaledWithin([0.3, 0.7, 1.1], factor);
      expect(readScales(scales, '.scale', fail)).toEqual(scales);
      expect(scales[2] / scales[0]).toBeCloseTo(11 / 3, 9);
    }
  });
});
