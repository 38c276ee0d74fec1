// The distances to the nearest occupied cell for rays of each octant of directions, with which hash contents skip empty
// space (docs/tile-format.md, section 7). Counterpart of src/representations/hash/content/occupancy_distance.cpp.
import type { OccupancyBits } from '../../raymarch/occupancy';

export const kFarthestOctantDistance = 15;
const kMaxCoarse = 128; // cells along an edge, unless kMaxRatio leaves more
const kMaxRatio = 4;

// Returns the number of finest cells along the edge of a coarse one.
export function ratioFor(finestCells: number): number {
  let ratio = 1;
  while (ratio < kMaxRatio && finestCells / ratio > kMaxCoarse) ratio *= 2;
  return ratio;
}

// Two grids: coarse cells far from occupied ones, and finest cells near them.
export interface OctantDistanceField {
  edge: number; // of the coarse grid, in cells
  // x fastest. For an empty cell and each octant o of directions (bit a of o is set if the octant points upwards along
  // axis a), the four bits from 4 o on are the edge, in cells, of the largest empty cube that begins at the cell and
  // extends into that octant, at most 15. For an occupied cell the lowest four bits are 0, and the other bits are its
  // index among the occupied cells (0 if the ratio is 1).
  coarse: Uint32Array;
  // If the ratio is above 1: for each occupied coarse cell its ratio³ finest cells, x fastest, with the same distances
  // in finest cells, or smaller ones where the neighbouring cells are not known to allow more; 0 for an occupied finest
  // cell.
  fine: Uint32Array;
}

// Returns undefined if the number of near cells is not the declared one, which is checked before they are allocated.
export function octantDistances(occupied: OccupancyBits, declaredNear?: number): OctantDistanceField | undefined {
  const ratio = ratioFor(occupied.edge);
  const cells = coarseCells(occupied, ratio);
  if (declaredNear !== undefined && ratio > 1 && cells.reduce((sum, cell) => sum + (cell > 0 ? 1 : 0), 0) !== declaredNear) return undefined;
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

// Returns the number of occupied finest cells in each coarse cell.
function coarseCells({ edge, bytes }: OccupancyBits, ratio: number): Uint8Array {
  const coarse = edge / ratio;
  const shift = Math.log2(ratio);
  const cells = new Uint8Array(coarse ** 3);
  let byte = 0; // each byte holds eight cells along x
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

// The distance is one more than the minimum over the seven next cells. Cells outside the grid count as empty.
function sweep(distances: Uint32Array, cells: Uint8Array, edge: number, octant: number): void {
  const shift = 4 * octant;
  // Towards the corner that the octant points to, where a sweep begins.
  const [dx, dy, dz] = [octant & 1 ? 1 : -1, octant & 2 ? edge : -edge, octant & 4 ? edge * edge : -edge * edge];
  for (let k = 0; k < edge; ++k) {
    for (let j = 0; j < edge; ++j) {
      const row = (dx > 0 ? edge - 1 : 0) + edge * (dy > 0 ? edge - 1 - j : j) + edge * edge * (dz > 0 ? edge - 1 - k : k);
      let next = kFarthestOctantDistance; // minimum of the four cells one step further along x
      for (let i = 0, cell = row; i < edge; ++i, cell -= dx) {
        let here = kFarthestOctantDistance; // minimum of the other three cells beside this one
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

const kSide = kMaxRatio + 1;

// Computes the distances of the finest cells in occupied coarse cells. Those of a finest cell in an empty coarse cell,
// which has k empty coarse cells along an edge in the octant, follow from its distance to the far end of these.
class NearSweep {
  private readonly up: boolean[];
  private readonly shift: number;
  // Distances of one coarse cell's finest cells and of the adjacent ones in the next coarse cells. Along an axis they
  // are numbered from 1 on, starting at the end that the octant points to; 0 is in the next cell.
  private readonly values = new Uint8Array(kSide ** 3);
  private readonly inside: Uint8Array[]; // coordinates of these within their coarse cell

  constructor(
    private readonly finest: OccupancyBits,
    private readonly into: OctantDistanceField,
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
          // A full coarse cell contains no empty cells.
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
        let next = minimum(values, at - 1);
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

  // Copies the needed distances from the next coarse cell along the axes whose bits are set.
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
        const offset = Math.max(j === 0 ? 0 : r - j, k === 0 ? 0 : r - k); // distance from the start of the coarse cube
        for (let i = 1 - dx; i <= (dx ? 0 : r); ++i) {
          values[i + kSide * (j + kSide * k)] = isEmpty
            ? Math.min(kFarthestOctantDistance, reach - Math.max(offset, i === 0 ? 0 : r - i))
            : (fine[row + insideX[i]] >>> shift) & 15;
        }
      }
    }
  }
}

// Returns the minimum of four cells that are adjacent across x.
function minimum(values: Uint8Array, at: number): number {
  return Math.min(values[at], values[at - kSide], values[at - kSide * kSide], values[at - kSide - kSide * kSide]);
}
