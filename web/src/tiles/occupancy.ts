// Grids of bits, and how far it is to the next one that is set: docs/tile-format.md, section 6.

// A grid of edge³ cells, (x, y, z) being number x + edge (y + edge z); one byte each, 0 or 1.
export interface OccupancyBits {
  edge: number;
  bits: Uint8Array;
}

export const kFarthestDistance = 255;

// The size of the picture that holds so many bits.
export function sizeOfBits(bits: number): { width: number; height: number } {
  const bytes = Math.ceil(bits / 8);
  let width = 256;
  while (Math.ceil(bytes / width) > 16383) width *= 2;
  return { width, height: Math.ceil(bytes / width) };
}

// From pixels of 4 bytes: undefined where a pixel is not grey, or a bit outside the grid is set.
export function takeBits(pixels: Uint8ClampedArray, edge: number): OccupancyBits | undefined {
  const count = edge ** 3;
  const bits = new Uint8Array(count);
  for (let byte = 0; byte < pixels.length / 4; ++byte) {
    const value = pixels[4 * byte];
    if (pixels[4 * byte + 1] !== value || pixels[4 * byte + 2] !== value) return undefined;
    if (value === 0) continue;
    const first = 8 * byte;
    if (first >= count || (count - first < 8 && value >> (count - first) !== 0)) return undefined;
    for (let bit = 0; bit < 8; ++bit) {
      if ((value >> bit) & 1) bits[first + bit] = 1;
    }
  }
  return { edge, bits };
}

// Of each cell the Chebyshev distance in cells to the nearest one that is set, 255 at most; 255 where none is. Two
// sweeps: each cell is at most one farther than any of the 13 neighbours that a sweep has been to.
export function chebyshevDistances({ edge, bits }: OccupancyBits): Uint8Array {
  const distances = new Uint8Array(bits.length);
  for (let i = 0; i < bits.length; ++i) distances[i] = bits[i] === 1 ? 0 : kFarthestDistance;
  sweep(distances, edge, false);
  sweep(distances, edge, true);
  return distances;
}

function sweep(distances: Uint8Array, edge: number, backwards: boolean): void {
  const step = backwards ? -1 : 1;
  const start = backwards ? edge - 1 : 0;
  const least = new Uint8Array(edge + 2).fill(kFarthestDistance); // of the rows before, with one more at each end
  const takeRow = (y: number, z: number) => {
    if (y < 0 || z < 0 || y >= edge || z >= edge) return;
    const row = edge * (y + edge * z);
    for (let x = 0; x < edge; ++x) least[x + 1] = Math.min(least[x + 1], distances[row + x]);
  };
  for (let i = 0, z = start; i < edge; ++i, z += step) {
    for (let j = 0, y = start; j < edge; ++j, y += step) {
      least.fill(kFarthestDistance);
      takeRow(y - step, z);
      for (let dy = -1; dy <= 1; ++dy) takeRow(y + dy, z - step);
      const row = edge * (y + edge * z);
      let before = kFarthestDistance;
      for (let k = 0, x = start; k < edge; ++k, x += step) {
        const near = Math.min(least[x], least[x + 1], least[x + 2], before);
        before = Math.min(distances[row + x], near + 1, kFarthestDistance);
        distances[row + x] = before;
      }
    }
  }
}
