import { beforeAll, describe, expect, it } from 'vitest';
import { decodeGolden, storedIn, Sum, testContentReader } from '../testing/content-tests';
import { goldenFile, goldenText, prepareDecoderInNode } from '../testing/golden';
import { kStoredEdge, type TexelTextures } from './content';
import { kEntriesOfRow, type HashContent } from './hash-content';
import { kFarthestOctantDistance } from './octant-distances';

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

// Eight columns of a corner in the order of the format.
function columnsAt({ size, first, second }: TexelTextures, x: number, y: number, z: number): number[] {
  const at = 4 * (x + size[0] * (y + size[1] * z));
  return [first[at + 3], ...first.subarray(at, at + 3), ...second.subarray(at, at + 4)];
}

// The numbers of a part's cube.
function* cubeOf(
  { size, origins, texels }: HashContent['occupied'] | HashContent['distances'], n: number, edge: number,
): Generator<number> {
  const [x0, y0, z0] = origins[n];
  for (let z = 0; z < edge; ++z) {
    for (let y = 0; y < edge; ++y) {
      for (let x = 0; x < edge; ++x) yield texels[x0 + x + size[0] * (y0 + y + size[1] * (z0 + z))];
    }
  }
}

describe('decodeHash', () => {
  it.each(uris)('reads of the golden scene what its sums say: %s', (uri) => {
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
        const first = 8 * kEntriesOfRow * content.tables.rowOf[n][level];
        sum.add(entries.subarray(first, first + 8 * table.entries));
        return sum;
      });
      let occupied = 0;
      for (const eight of cubeOf(content.occupied, n, part.cells / 2)) {
        for (let bit = 0; bit < 8; ++bit) occupied += (eight >> bit) & 1;
      }
      let distances = 0;
      for (const word of cubeOf(content.distances, n, part.cells)) {
        for (let octant = 0; octant < 8; ++octant) distances += (word >>> (4 * octant)) & kFarthestOctantDistance;
      }
      expect({
        stored: stored.length, firstStored: stored[0]?.number ?? -1, occupied, distances,
        corners: corners.plain, cornersOrdered: corners.ordered,
        tables: tables.map((sum) => sum.plain), tablesOrdered: tables.map((sum) => sum.ordered),
      }).toEqual(sums[uri][n]);
    });
  });

  testContentReader('hash', uris);
});
