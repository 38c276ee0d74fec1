import { beforeAll, describe, expect, it } from 'vitest';
import { kStoredEdge, type TexelTextures } from '../../raymarch/content';
import { decodeGolden, storedIn, Sum, testContentReader, testMarchedReader } from '../../testing/content-tests';
import { goldenFile, goldenText, prepareDecoderInNode } from '../../testing/golden';
import { kDistanceCell, type VolumeContent } from './volume-content';

interface Sums {
  stored: number;
  firstStored: number;
  occupied: number;
  distances: number;
  voxels: number;
  voxelsOrdered: number;
  planes: number[];
  planesOrdered: number[];
}

const sums = JSON.parse(goldenText('sums.json')) as Record<string, Sums[]>;
const uris = Object.keys(sums);

beforeAll(prepareDecoderInNode);

// The 8 attributes of a texel in the order of the format.
function attributesAt({ size, first, second }: TexelTextures, x: number, y: number, z: number): number[] {
  const at = 4 * (x + size[0] * (y + size[1] * z));
  return [first[at + 3], ...first.subarray(at, at + 3), ...second.subarray(at, at + 4)];
}

describe('decodeVolume', () => {
  it.each(uris)('decodes the golden scene to its checksums: %s', (uri) => {
    const content = decodeGolden('volume', goldenFile(uri)) as VolumeContent;
    expect(content.parts.length).toBe(sums[uri].length);
    content.parts.forEach((part, n) => {
      const expected = sums[uri][n];
      const voxels = new Sum();
      const stored = storedIn(content, n, part.voxels / 8);
      for (const { place: [ax, ay, az] } of stored) {
        for (let k = 0; k < kStoredEdge; ++k) {
          for (let j = 0; j < kStoredEdge; ++j) {
            for (let i = 0; i < kStoredEdge; ++i) {
              voxels.add(attributesAt(content.voxels, kStoredEdge * ax + i, kStoredEdge * ay + j, kStoredEdge * az + k));
            }
          }
        }
      }
      const planes = [new Sum(), new Sum(), new Sum()];
      planes.forEach((sum, axis) => {
        for (let row = 0; row < part.planes; ++row) {
          for (let column = 0; column < part.planes; ++column) {
            sum.add(attributesAt(content.planes, column, row, 3 * n + axis));
          }
        }
      });
      const cells = part.planes / kDistanceCell;
      const [dx, dy, dz] = content.distances.origins[n];
      let occupied = 0;
      let distances = 0;
      for (let z = 0; z < cells; ++z) {
        for (let y = 0; y < cells; ++y) {
          for (let x = 0; x < cells; ++x) {
            const { size, texels } = content.distances;
            const distance = texels[dx + x + size[0] * (dy + y + size[1] * (dz + z))];
            occupied += distance === 0 ? 1 : 0;
            distances += distance;
          }
        }
      }
      expect({
        stored: stored.length, firstStored: stored[0]?.number ?? -1, occupied, distances,
        voxels: voxels.plain, voxelsOrdered: voxels.ordered,
        planes: planes.map((sum) => sum.plain), planesOrdered: planes.map((sum) => sum.ordered),
      }).toEqual(expected);
    });
  });

  testContentReader('volume', uris);
  testMarchedReader('volume', uris);
});
