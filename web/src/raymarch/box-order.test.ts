import { describe, expect, it } from 'vitest';
import { randomNumbers } from '../testing/test-tree';
import type { Box, Vec3 } from '../tiles/tileset';
import { frontToBack } from './box-order';

function entry({ low, high }: Box, eye: Vec3, d: Vec3): number | undefined {
  let [near, far] = [0, Infinity];
  for (let a = 0; a < 3; ++a) {
    const [s, t] = [(low[a] - eye[a]) / d[a], (high[a] - eye[a]) / d[a]];
    near = Math.max(near, Math.min(s, t));
    far = Math.min(far, Math.max(s, t));
  }
  return far - near > 1e-9 ? near : undefined;
}

describe('boxes', () => {
  it('of a grid are sorted in the order in which rays meet them', () => {
    const random = randomNumbers(9);
    const boxes: Box[] = [];
    const walls = [-3, -1, 0.5, 3];
    for (let x = 0; x < 3; ++x) {
      for (let y = 0; y < 3; ++y) {
        // Boxes of various heights, with gaps.
        if (random() < 0.8) boxes.push({ low: [walls[x], walls[y], -1], high: [walls[x + 1], walls[y + 1], random()] });
      }
    }
    for (let round = 0; round < 3000; ++round) {
      const spread = () => (random() - 0.5) * 10;
      const eye: Vec3 = [spread(), spread(), spread()];
      const d: Vec3 = [spread(), spread(), spread()];
      const order = frontToBack(boxes, eye);
      expect([...order].sort((a, b) => a - b)).toEqual([...boxes.keys()]);
      const entries = order.map((i) => entry(boxes[i], eye, d)).filter((t) => t !== undefined);
      entries.forEach((t, i) => expect(i === 0 || t >= entries[i - 1] - 1e-9).toBe(true));
    }
  });
});
