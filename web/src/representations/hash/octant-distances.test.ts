import { describe, expect, it } from 'vitest';
import { isSet, type OccupancyBits } from '../../raymarch/occupancy';
import { randomNumbers } from '../../testing/test-tree';
import { kFarthestOctantDistance, octantDistances, ratioFor } from './octant-distances';

function testBits(edge: number, share: number, seed: number): OccupancyBits {
  const random = randomNumbers(seed);
  const bytes = new Uint8Array(edge ** 3 / 8);
  for (let cell = 0; cell < edge ** 3; ++cell) if (random() < share) bytes[cell >> 3] |= 1 << (cell & 7);
  return { edge, bytes };
}

// Finds the edge of the largest empty cube from a cell on by testing each cell.
function freeFrom(edge: number, at: number[], octant: number, occupied: (x: number, y: number, z: number) => boolean): number {
  const inside = (x: number) => x >= 0 && x < edge;
  for (let k = 1; k <= kFarthestOctantDistance; ++k) {
    for (let n = 0; n < k ** 3; ++n) {
      const offset = [n % k, Math.floor(n / k) % k, Math.floor(n / k ** 2)];
      const [x, y, z] = at.map((one, a) => one + ((octant >> a) & 1 ? offset[a] : -offset[a]));
      if (inside(x) && inside(y) && inside(z) && occupied(x, y, z)) return k - 1;
    }
  }
  return kFarthestOctantDistance;
}

describe('octantDistances', () => {
  it.each([0.3, 0.02, 0.002, 0])('are the edges of the largest empty cubes: a share of %s occupied', (share) => {
    const edge = 16;
    const bits = testBits(edge, share, 7);
    const { coarse, fine } = octantDistances(bits)!;
    expect(fine.length).toBe(0);
    const random = randomNumbers(1);
    for (let round = 0; round < 300; ++round) {
      const at = [0, 1, 2].map(() => Math.floor(random() * edge));
      const octant = Math.floor(random() * 8);
      const distance = (coarse[at[0] + edge * (at[1] + edge * at[2])] >>> (4 * octant)) & kFarthestOctantDistance;
      expect(distance).toBe(freeFrom(edge, at, octant, (x, y, z) => isSet(bits, x + edge * (y + edge * z))));
    }
  });

  it.each([136, 264])('are stored in two grids if there are many cells, and never skip an occupied one: %i', (edge) => {
    const bits = testBits(edge, 3e-5, 3);
    const ratio = ratioFor(edge);
    expect(ratio).toBe(edge > 256 ? 4 : 2);
    const { edge: coarseEdge, coarse, fine } = octantDistances(bits)!;
    expect(coarseEdge).toBe(edge / ratio);
    const occupied = (x: number, y: number, z: number) => isSet(bits, x + edge * (y + edge * z));
    let near = 0;
    let wrong = 0;
    coarse.forEach((word, cell) => {
      if ((word & 15) !== 0) return;
      const corner = [cell % coarseEdge, Math.floor(cell / coarseEdge) % coarseEdge, Math.floor(cell / coarseEdge ** 2)];
      for (let n = 0; n < ratio ** 3; ++n) {
        const at = [n % ratio, Math.floor(n / ratio) % ratio, Math.floor(n / ratio ** 2)].map((x, a) => ratio * corner[a] + x);
        const value = fine[(word >>> 4) * ratio ** 3 + n];
        const isOccupied = occupied(at[0], at[1], at[2]);
        if ((value === 0) !== isOccupied) ++wrong;
        if (isOccupied || near++ % 50 !== 0) continue;
        for (let octant = 0; octant < 8; ++octant) {
          const distance = (value >>> (4 * octant)) & kFarthestOctantDistance;
          if (distance < 1 || distance > freeFrom(edge, at, octant, occupied)) ++wrong;
        }
      }
    });
    expect(near).toBeGreaterThan(400);
    const declared = fine.length / ratio ** 3;
    expect(octantDistances(bits, declared)).toBeDefined();
    for (const lie of [0, declared - 1, declared + 1]) expect(octantDistances(bits, lie)).toBeUndefined();
    expect(wrong).toBe(0);
  });
});
