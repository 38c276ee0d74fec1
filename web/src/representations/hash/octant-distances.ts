// How far nothing is for rays of each octant of directions: what hash contents pass over empty space with
// (docs/tile-format.md, section 7). Twin of src/representations/hash/content/occupancy_distance.cpp.
import type { OccupancyBits } from '../../raymarch/occupancy';

export const kFarthestOctantDistance = 15;
const kMostCoarse = 128; // cells along an edge, unless kMostRatio makes more
const kMostRatio = 4;

// Finest cells along an edge of a coarse one.
export function ratioFor(finestCells: number): number {
  let ratio = 1;
  while (ratio < kMostRatio && finestCells / ratio > kMostCoarse) ratio *= 2;
  return ratio;
}

// In two grids: far away by coarse cells, near what is occupied by the finest ones.
export interface OctantDistances {
  edge: number; // of the coarse grid, in cells
  // x fastest. Of an empty cell, and each octant o of directions (bit a of o: along axis a upwards), the four bits from 4 o
  // on are the number of cells along an edge of the largest empty cube that begins at the cell and lies in that direction, at
  // most 15. Of a cell that holds something the lowest four bits are 0, and the others its number among such (0 where the
  // ratio is 1).
  coarse: Uint32Array;
  // Where the ratio is above 1, of each such cell its ratio³ finest ones, x fastest: the same in finest cells, or less where
  // the next cells' are not known to be more; 0 where the cell is occupied.
  fine: Uint32Array;
}

// Undefined where there are not as many near cells as was promised, which is seen before there is room for them.
export function octantDistances(occupied: OccupancyBits, promisedNear?: number): OctantDistances | undefined {
  const ratio = ratioFor(occupied.edge);
  const cells = coarseCells(occupied, ratio);
  if (promisedNear !== undefined && ratio > 1 && cells.reduce((sum, cell) => sum + (cell > 0 ? 1 : 0), 0) !== promisedNear) return undefined;
  const edge = occupied.edge / ratio;
  const coarse = new Uint32Array(edge ** 3);
  for (let octant = 0; octant < 8; ++octant) sweep(coarse, cells, edge, octant);
  if (ratio === 1) return { edge, coarse, fine: new Uint32Array(0) };
  let number = 0;
  for (let cell = 0; cell < coarse.length; ++cell) if (cells[cell] !== 0) coarse[cell] = number++ << 4;
  const distances = { edge, coarse, fine: new Uint32Array(number * ratio ** 3) };
  for (let octant = 0; octant < 8; ++octant) new NearSweep(occupied, distances, cells, ratio, octant).run();
  return distances;
}

// Of each cell, how many of its finest ones are occupied.
function coarseCells({ edge, bytes }: OccupancyBits, ratio: number): Uint8Array {
  const coarse = edge / ratio;
  const shift = Math.log2(ratio);
  const cells = new Uint8Array(coarse ** 3);
  let byte = 0; // eight cells along x
  for (let z = 0; z < edge; ++z) {
    for (let y = 0; y < edge; ++y) {
      const row = coarse * ((y >> shift) + coarse * (z >> shift));
      for (let x = 0; x < edge; x += 8, ++byte) {
        for (let bits = bytes[byte], bit = x; bits !== 0; bits >>= 1, ++bit) cells[row + (bit >> shift)] += bits & 1;
      }
    }
  }
  return cells;
}

// One more than the least of the seven next cells'. What lies beyond counts as empty.
function sweep(distances: Uint32Array, cells: Uint8Array, edge: number, octant: number): void {
  const shift = 4 * octant;
  // Towards the octant's own corner, where a sweep begins.
  const [dx, dy, dz] = [octant & 1 ? 1 : -1, octant & 2 ? edge : -edge, octant & 4 ? edge * edge : -edge * edge];
  for (let k = 0; k < edge; ++k) {
    for (let j = 0; j < edge; ++j) {
      const row = (dx > 0 ? edge - 1 : 0) + edge * (dy > 0 ? edge - 1 - j : j) + edge * edge * (dz > 0 ? edge - 1 - k : k);
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

const kSide = kMostRatio + 1;

// Of the finest cells in coarse ones that hold something. In an empty coarse cell, of whose octant k coarse cells are empty
// along an edge, what is so of a finest one is what is left of these.
class NearSweep {
  private readonly up: boolean[];
  private readonly shift: number;
  // Of one coarse cell's finest ones, and of the next ones beside it. Along an axis they are numbered from the end towards
  // which the octant looks, from 1 on; 0 is in the next cell.
  private readonly values = new Uint8Array(kSide ** 3);
  private readonly inside: Uint8Array[]; // where these are in their coarse cell

  constructor(
    private readonly finest: OccupancyBits,
    private readonly into: OctantDistances,
    private readonly cells: Uint8Array,
    private readonly ratio: number,
    octant: number,
  ) {
    this.up = [0, 1, 2].map((a) => ((octant >> a) & 1) === 1);
    this.shift = 4 * octant;
    this.inside = this.up.map((up) =>
      Uint8Array.from({ length: ratio + 1 }, (_, i) => (up ? (i === 0 ? 0 : ratio - i) : i === 0 ? ratio - 1 : i - 1)));
  }

  run(): void {
    const { into: { edge, coarse }, cells, ratio, up } = this;
    for (let k = 0; k < edge; ++k) {
      const z = up[2] ? edge - 1 - k : k;
      for (let j = 0; j < edge; ++j) {
        const y = up[1] ? edge - 1 - j : j;
        for (let i = 0; i < edge; ++i) {
          const x = up[0] ? edge - 1 - i : i;
          const cell = x + edge * (y + edge * z);
          // Of one that is full nothing is empty.
          if ((coarse[cell] & 15) === 0 && cells[cell] < ratio ** 3) this.sweep(x, y, z, coarse[cell] >>> 4);
        }
      }
    }
  }

  private sweep(x: number, y: number, z: number, number: number): void {
    const { ratio: r, values, shift, into: { fine }, inside: [insideX, insideY, insideZ], finest: { edge, bytes } } = this;
    for (let axes = 1; axes < 8; ++axes) this.takeNext(x, y, z, axes);
    for (let k = 1; k <= r; ++k) {
      for (let j = 1; j <= r; ++j) {
        const row = edge * (r * y + insideY[j] + edge * (r * z + insideZ[k])) + r * x;
        const fineRow = r * (insideY[j] + r * (insideZ[k] + r * number));
        let at = 1 + kSide * (j + kSide * k);
        let next = least(values, at - 1);
        for (let i = 1; i <= r; ++i, ++at) {
          const cell = row + insideX[i];
          const here = Math.min(values[at - kSide], values[at - kSide * kSide], values[at - kSide - kSide * kSide]);
          const isOccupied = (bytes[cell >> 3] >> (cell & 7)) & 1;
          const free = isOccupied ? 0 : Math.min(kFarthestOctantDistance, 1 + Math.min(here, next));
          values[at] = free;
          next = Math.min(here, free);
          fine[fineRow + insideX[i]] |= free << shift;
        }
      }
    }
  }

  // What is needed of the next coarse cell along the axes whose bits are set.
  private takeNext(x: number, y: number, z: number, axes: number): void {
    const { ratio: r, values, up, shift, inside: [insideX, insideY, insideZ], into: { edge, coarse, fine } } = this;
    const [dx, dy, dz] = [axes & 1, (axes >> 1) & 1, axes >> 2];
    const cx = up[0] ? x + dx : x - dx;
    const cy = up[1] ? y + dy : y - dy;
    const cz = up[2] ? z + dz : z - dz;
    const outside = cx < 0 || cy < 0 || cz < 0 || cx === edge || cy === edge || cz === edge;
    const word = outside ? 0xffffffff : coarse[cx + edge * (cy + edge * cz)];
    const isEmpty = (word & 15) !== 0;
    const reach = outside ? 2 * kFarthestOctantDistance : r * ((word >>> shift) & 15);
    const first = r ** 3 * (word >>> 4);
    for (let k = 1 - dz; k <= (dz ? 0 : r); ++k) {
      for (let j = 1 - dy; j <= (dy ? 0 : r); ++j) {
        const row = first + r * (insideY[j] + r * insideZ[k]);
        const offset = Math.max(j === 0 ? 0 : r - j, k === 0 ? 0 : r - k); // from where the coarse cube begins
        for (let i = 1 - dx; i <= (dx ? 0 : r); ++i) {
          values[i + kSide * (j + kSide * k)] = isEmpty
            ? Math.min(kFarthestOctantDistance, reach - Math.max(offset, i === 0 ? 0 : r - i))
            : (fine[row + insideX[i]] >>> shift) & 15;
        }
      }
    }
  }
}

// Of four that lie beside one another, across x.
function least(values: Uint8Array, at: number): number {
  return Math.min(values[at], values[at - kSide], values[at - kSide * kSide], values[at - kSide - kSide * kSide]);
}
