// Occupancy grids of bits, and distances to the nearest occupied cell: docs/tile-format.md, section 6.

// A grid of edge³ cells: cell (x, y, z) has index n = x + edge (y + edge z), which is bit n % 8 of byte n / 8.
export interface OccupancyBits {
  edge: number;
  bytes: Uint8Array;
}

export const kFarthestDistance = 255;

// Reads a grid from RGBA pixels. Returns undefined if a pixel is not grey, or a bit outside the grid is set.
export function takeBits(pixels: Uint8ClampedArray, edge: number): OccupancyBits | undefined {
  const count = edge ** 3;
  const bytes = new Uint8Array(Math.ceil(count / 8));
  for (let byte = 0; byte < pixels.length / 4; ++byte) {
    const value = pixels[4 * byte];
    if (pixels[4 * byte + 1] !== value || pixels[4 * byte + 2] !== value) return undefined;
    if (value === 0) continue;
    const left = count - 8 * byte;
    if (left <= 0 || (left < 8 && value >> left !== 0)) return undefined;
    bytes[byte] = value;
  }
  return { edge, bytes };
}

export function isSet({ bytes }: OccupancyBits, cell: number): boolean {
  return ((bytes[cell >> 3] >> (cell & 7)) & 1) === 1;
}

// Returns for each cell the Chebyshev distance in cells to the nearest occupied cell, at most 255; 255 if there is
// none. Two sweeps suffice: each cell is at most one farther than any of the 13 neighbours that a sweep has visited.
export function chebyshevDistances(occupied: OccupancyBits): Uint8Array {
  const { edge } = occupied;
  const distances = new Uint8Array(edge ** 3);
  for (let i = 0; i < distances.length; ++i) distances[i] = isSet(occupied, i) ? 0 : kFarthestDistance;
  sweep(distances, edge, false);
  sweep(distances, edge, true);
  return distances;
}

function sweep(distances: Uint8Array, edge: number, backwards: boolean): void {
  const step = backwards ? -1 : 1;
  const start = backwards ? edge - 1 : 0;
  const minimum = new Uint8Array(edge + 2).fill(kFarthestDistance); // minimum over the previous rows, with one more cell at each end
  const takeRow = (y: number, z: number) => {
    if (y < 0 || z < 0 || y >= edge || z >= edge) return;
    const row = edge * (y + edge * z);
    for (let x = 0; x < edge; ++x) minimum[x + 1] = Math.min(minimum[x + 1], distances[row + x]);
  };
  for (let i = 0, z = start; i < edge; ++i, z += step) {
    for (let j = 0, y = start; j < edge; ++j, y += step) {
      minimum.fill(kFarthestDistance);
      takeRow(y - step, z);
      for (let dy = -1; dy <= 1; ++dy) takeRow(y + dy, z - step);
      const row = edge * (y + edge * z);
      let before = kFarthestDistance;
      for (let k = 0, x = start; k < edge; ++k, x += step) {
        const near = Math.min(minimum[x], minimum[x + 1], minimum[x + 2], before);
        before = Math.min(distances[row + x], near + 1, kFarthestDistance);
        distances[row + x] = before;
      }
    }
  }
}
