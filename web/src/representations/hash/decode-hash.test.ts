import { beforeAll, describe, expect, it } from 'vitest';
import { kStoredEdge, type TexelTextures } from '../../raymarch/content';
import { decodeGolden, storedIn, Sum, testContentReader, testMarchedReader } from '../../testing/content-tests';
import { goldenFile, goldenText, prepareDecoderInNode } from '../../testing/golden';
import { kLengthOfRow, type HashContent } from './hash-content';
import { paddedLength, layOutLists } from './hash-layout';
import { kFarthestOctantDistance, ratioFor } from './octant-distances';

interface Sums {
  stored: number;
  firstStored: number;
  occupied: number;
  distances: number;
  corners: number;
  cornersOrdered: number;
  tables: number[];
  tablesOrdered: number[];
}

const sums = JSON.parse(goldenText('sums.json', 'hash')) as Record<string, Sums[]>;
const uris = Object.keys(sums);

beforeAll(prepareDecoderInNode);

// The eight columns of a corner in the order of the format.
function columnsAt({ size, first, second }: TexelTextures, x: number, y: number, z: number): number[] {
  const at = 4 * (x + size[0] * (y + size[1] * z));
  return [first[at + 3], ...first.subarray(at, at + 3), ...second.subarray(at, at + 4)];
}

// Returns the numbers of a part's cube.
function* cubeValues(
  { size, origins, texels }: HashContent['distances'], n: number, edge: number,
): Generator<number> {
  const [x0, y0, z0] = origins[n];
  for (let z = 0; z < edge; ++z) {
    for (let y = 0; y < edge; ++y) {
      for (let x = 0; x < edge; ++x) yield texels[x0 + x + size[0] * (y0 + y + size[1] * (z0 + z))];
    }
  }
}

describe('decodeHash', () => {
  it.each(uris)('decodes the golden scene to its checksums: %s', (uri) => {
    const content = decodeGolden('hash', goldenFile(uri, 'hash')) as HashContent;
    expect(content.parts.length).toBe(sums[uri].length);
    content.parts.forEach((part, n) => {
      const corners = new Sum();
      const stored = storedIn(content, n, part.lattice / 8);
      for (const { place: [ax, ay, az] } of stored) {
        for (let k = 0; k < kStoredEdge; ++k) {
          for (let j = 0; j < kStoredEdge; ++j) {
            for (let i = 0; i < kStoredEdge; ++i) {
              const place = [kStoredEdge * ax + i, kStoredEdge * ay + j, kStoredEdge * az + k] as const;
              corners.add(content.corners.flatMap((eight) => columnsAt(eight, ...place)));
            }
          }
        }
      }
      const entries = new Uint8Array(content.tables.words.buffer);
      const tables = part.tables.map((table, level) => {
        const sum = new Sum();
        const first = 8 * kLengthOfRow * content.tables.firstRows[n * part.tables.length + level];
        sum.add(entries.subarray(first, first + 8 * table.entries));
        return sum;
      });
      // The occupied cells of the coarse grid, then those of the near cells.
      const ratio = ratioFor(part.cells);
      const add = (word: number) => {
        for (let octant = 0; octant < 8; ++octant) distances += (word >>> (4 * octant)) & kFarthestOctantDistance;
      };
      let distances = 0;
      let occupied = 0;
      for (const word of cubeValues(content.distances, n, part.cells / ratio)) {
        if ((word & 15) !== 0) add(word);
        else if (ratio === 1) ++occupied;
      }
      const near = kLengthOfRow * content.nearDistances.firstRows[n];
      for (const word of content.nearDistances.words.subarray(near, near + part.nearCells * ratio ** 3)) {
        add(word);
        occupied += word === 0 ? 1 : 0;
      }
      expect({
        stored: stored.length, firstStored: stored[0]?.number ?? -1, occupied, distances,
        corners: corners.plain, cornersOrdered: corners.ordered,
        tables: tables.map((sum) => sum.plain), tablesOrdered: tables.map((sum) => sum.ordered),
      }).toEqual(sums[uri][n]);
    });
  });

  it('lays lists out in rows and layers that fit GPU textures', () => {
    expect(layOutLists([1, 2048, 2049, 0])).toEqual({ rows: 4, layers: 1, firstRows: [0, 1, 2, 4] });
    expect(layOutLists([2 ** 22 - 1, 5])).toEqual({ rows: 2048, layers: 2, firstRows: [0, 2048] });
    expect(paddedLength(layOutLists([2 ** 22 - 1, 5]))).toBe(2 ** 23);
    expect(layOutLists([0, 0])).toEqual({ rows: 0, layers: 0, firstRows: [0, 0] });
  });

  testContentReader('hash', uris, uris.filter((uri) => uri.startsWith('tiles/L0')));
  testMarchedReader('hash', uris);
});
