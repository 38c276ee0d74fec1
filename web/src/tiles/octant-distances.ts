// How far nothing is for rays of each octant of directions: what hash contents pass over empty space with
// (docs/tile-format.md, section 7). Twin of src/tiles/occupancy_distance.cpp.
import type { OccupancyBits } from './occupancy';

// A byte a cell, not 0 where it is occupied; x fastest.
export interface Cells {
  edge: number;
  cells: Uint8Array;
}

export const kFarthestOctantDistance = 15;

// Of each 2 × 2 × 2 cells one byte: bit x + 2 y + 4 z is the one at (x, y, z) among them. `edge` is a multiple of 8.
export function eightsOf({ edge, bytes }: OccupancyBits): Cells {
  const half = edge / 2;
  const cells = new Uint8Array(half ** 3);
  let byte = 0; // eight cells along x
  for (let z = 0; z < edge; ++z) {
    for (let y = 0; y < edge; ++y) {
      const shift = 2 * (y & 1) + 4 * (z & 1);
      const row = half * ((y >> 1) + half * (z >> 1));
      for (let x = 0; x < half; x += 4, ++byte) {
        const bits = bytes[byte];
        if (bits === 0) continue;
        for (let k = 0; k < 4; ++k) cells[row + x + k] |= ((bits >> (2 * k)) & 3) << shift;
      }
    }
  }
  return { edge: half, cells };
}

// Of half as many cells along an edge, which is even: occupied where one of eight is.
export function halved({ edge, cells }: Cells): Cells {
  const half = edge / 2;
  const coarse = new Uint8Array(half ** 3);
  let from = 0;
  for (let z = 0; z < edge; ++z) {
    for (let y = 0; y < edge; ++y) {
      const row = half * ((y >> 1) + half * (z >> 1));
      for (let x = 0; x < edge; ++x, ++from) if (cells[from] !== 0) coarse[row + (x >> 1)] = 1;
    }
  }
  return { edge: half, cells: coarse };
}

// Of each octant o of directions (bit a of o: along axis a upwards), the four bits from 4 o on are the number of cells
// along an edge of the largest empty cube that begins at the cell and lies in that direction, at most 15; 0 in occupied
// cells. One more than the least of the seven next cells': a sweep for each octant. What lies beyond counts as empty.
export function octantDistances({ edge, cells }: Cells): Uint32Array {
  const distances = new Uint32Array(edge ** 3);
  for (let octant = 0; octant < 8; ++octant) sweep(distances, cells, edge, octant);
  return distances;
}

function sweep(distances: Uint32Array, cells: Uint8Array, edge: number, octant: number): void {
  const shift = 4 * octant;
  // Towards the octant's own corner, where a sweep begins.
  const [dx, dy, dz] = [octant & 1 ? 1 : -1, octant & 2 ? edge : -edge, octant & 4 ? edge * edge : -edge * edge];
  const first = (up: number) => (up > 0 ? edge - 1 : 0);
  for (let k = 0; k < edge; ++k) {
    for (let j = 0; j < edge; ++j) {
      const row = first(dx) + edge * (dy > 0 ? edge - 1 - j : j) + edge * edge * (dz > 0 ? edge - 1 - k : k);
      let next = kFarthestOctantDistance; // the least of the four cells one place further along x
      for (let i = 0, cell = row; i < edge; ++i, cell -= dx) {
        let here = kFarthestOctantDistance; // and of the three that lie beside this one
        if (j > 0) here = Math.min(here, (distances[cell + dy] >>> shift) & 15);
        if (k > 0) here = Math.min(here, (distances[cell + dz] >>> shift) & 15);
        if (j > 0 && k > 0) here = Math.min(here, (distances[cell + dy + dz] >>> shift) & 15);
        const free = cells[cell] !== 0 ? 0 : Math.min(kFarthestOctantDistance, 1 + Math.min(here, next));
        distances[cell] |= free << shift;
        next = Math.min(here, free);
      }
    }
  }
}
