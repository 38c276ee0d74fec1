import { expect, it } from 'vitest';
import { splitPicture } from './screenshot';

it('the pieces of a screenshot cover it exactly once', () => {
  const times = new Uint8Array(300 * 170);
  const pieces = splitPicture(300, 170, 64);
  for (const [left, top, width, height] of pieces) {
    expect(width).toBeLessThanOrEqual(64);
    expect(height).toBeLessThanOrEqual(64);
    for (let y = top; y < top + height; ++y) for (let x = left; x < left + width; ++x) ++times[x + 300 * y];
  }
  expect(times.every((count) => count === 1)).toBe(true);
});
