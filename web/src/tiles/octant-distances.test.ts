import { describe, expect, it } from 'vitest';
import { randomNumbers } from '../testing/made-tree';
import { isSet, type OccupancyBits } from './occupancy';
import { eightsOf, halved, kFarthestOctantDistance, octantDistances } from './octant-distances';

function madeBits(edge: number, share: number, seed: number): OccupancyBits {
  const random = randomNumbers(seed);
  const bytes = new Uint8Array(edge ** 3 / 8);
  for (let cell = 0; cell < edge ** 3; ++cell) if (random() < share) bytes[cell >> 3] |= 1 << (cell & 7);
  return { edge, bytes };
}

// The edge of the largest empty cube from a cell on, looked at cell by cell.
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
    const bits = madeBits(edge, share, 7);
    const cells = Uint8Array.from({ length: edge ** 3 }, (_, cell) => (isSet(bits, cell) ? 1 : 0));
    const distances = octantDistances({ edge, cells });
    const random = randomNumbers(1);
    for (let round = 0; round < 300; ++round) {
      const at = [0, 1, 2].map(() => Math.floor(random() * edge));
      const octant = Math.floor(random() * 8);
      const found = (distances[at[0] + edge * (at[1] + edge * at[2])] >>> (4 * octant)) & kFarthestOctantDistance;
      expect(found).toBe(freeFrom(edge, at, octant, (x, y, z) => cells[x + edge * (y + edge * z)] === 1));
    }
  });
});

describe('coarser cells', () => {
  it('hold the bits of eight finer ones, and are occupied where one of them is', () => {
    const edge = 16;
    const bits = madeBits(edge, 0.05, 3);
    const eights = eightsOf(bits);
    const quarter = halved(eights);
    expect([eights.edge, quarter.edge]).toEqual([8, 4]);
    const anyIn = new Set<number>();
    for (let z = 0; z < edge; ++z) {
      for (let y = 0; y < edge; ++y) {
        for (let x = 0; x < edge; ++x) {
          const set = isSet(bits, x + edge * (y + edge * z));
          const eight = eights.cells[(x >> 1) + 8 * ((y >> 1) + 8 * (z >> 1))];
          expect(((eight >> ((x & 1) + 2 * (y & 1) + 4 * (z & 1))) & 1) === 1).toBe(set);
          if (set) anyIn.add((x >> 2) + 4 * ((y >> 2) + 4 * (z >> 2)));
        }
      }
    }
    quarter.cells.forEach((cell, n) => expect(cell !== 0).toBe(anyIn.has(n)));
  });
});
