import { beforeAll, describe, expect, it } from 'vitest';
import { SceneError } from '../scene-error';
import { goldenFile, goldenText, prepareDecoderInNode } from '../testing/golden';
import { decodeTileset } from './decode-tileset';
import { decodeVolume, kVolumeLimits, readVolumeHeader } from './decode-volume';
import { kDistanceCell, kStoredEdge, type TexelTextures, type VolumeContent } from './volume-content';

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

function decode(file: Uint8Array, limits = kVolumeLimits): VolumeContent {
  return decodeVolume(readVolumeHeader(file, 'a.glb', undefined, limits), 'a.glb');
}

// The 8 attributes of a texel in the order of the format.
function attributesAt({ size, first, second }: TexelTextures, x: number, y: number, z: number): number[] {
  const at = 4 * (x + size[0] * (y + size[1] * z));
  return [first[at + 3], ...first.subarray(at, at + 3), ...second.subarray(at, at + 4)];
}

class Sum {
  plain = 0;
  ordered = 0;
  private next = 0;
  add(bytes: number[]): void {
    for (const byte of bytes) {
      this.plain += byte;
      this.ordered += ((this.next++ % 251) + 1) * byte;
    }
  }
}

describe('decodeVolume', () => {
  it.each(uris)('reads of the golden scene what its sums say: %s', (uri) => {
    const content = decode(goldenFile(uri));
    expect(content.parts.length).toBe(sums[uri].length);
    content.parts.forEach((part, n) => {
      const expected = sums[uri][n];
      const edge = part.voxels / 8;
      const [mx, my, mz] = content.macroblocks.origins[n];
      const voxels = new Sum();
      let stored = 0;
      let firstStored = -1;
      for (let number = 0; number < edge ** 3; ++number) {
        const x = mx + (number % edge);
        const y = my + (Math.floor(number / edge) % edge);
        const z = mz + Math.floor(number / edge ** 2);
        const { size, texels } = content.macroblocks;
        const at = 4 * (x + size[0] * (y + size[1] * z));
        const [ax, ay, az, isStored] = texels.subarray(at, at + 4);
        if (!isStored) continue;
        if (stored++ === 0) firstStored = number;
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
        stored, firstStored, occupied, distances,
        voxels: voxels.plain, voxelsOrdered: voxels.ordered,
        planes: planes.map((sum) => sum.plain), planesOrdered: planes.map((sum) => sum.ordered),
      }).toEqual(expected);
    });
  });

  it('knows what textures will take before it decodes them', () => {
    for (const uri of uris) {
      const header = readVolumeHeader(goldenFile(uri), uri);
      const { planes, voxels, macroblocks, distances } = decodeVolume(header, uri);
      const bytes = 2 * (planes.first.length + voxels.first.length) + macroblocks.texels.length + distances.texels.length;
      expect(header.layout.bytes).toBe(bytes);
    }
  });

  it('refuses what would take more memory than allowed, or more than a texture holds', () => {
    const file = goldenFile(uris[0]);
    const { bytes } = readVolumeHeader(file, 'a').layout;
    expect(() => readVolumeHeader(file, 'a', undefined, { ...kVolumeLimits, bytes: bytes - 1 })).toThrow('bytes of memory');
    expect(() => readVolumeHeader(file, 'a', undefined, { ...kVolumeLimits, layers: 2 })).toThrow('in one texture');
    expect(() => readVolumeHeader(file, 'a', undefined, { ...kVolumeLimits, edge3D: 8 })).toThrow('in one texture');
  });

  it('refuses a content that is not the one that tileset.json speaks of', () => {
    const tileset = decodeTileset(goldenText('tileset.json'), 'tileset.json');
    const contents = tileset.tiles.flatMap((tile) => tile.contents);
    for (const promised of contents) {
      const file = goldenFile(promised.uri);
      expect(() => readVolumeHeader(file, promised.uri, promised)).not.toThrow();
      expect(() => readVolumeHeader(file, 'a', { ...promised, surround: !promised.surround })).toThrow('surround');
      const small = { low: promised.box.low, high: promised.box.low };
      expect(() => readVolumeHeader(file, 'a', { ...promised, box: small })).toThrow('owns what lies outside');
    }
  });

  it('refuses every file that is cut off', () => {
    const file = goldenFile(uris[0]);
    for (let length = 0; length < file.length; length += 97) {
      expect(() => decode(file.subarray(0, length))).toThrow(SceneError);
    }
  });

  it('decodes mutated files or names what is wrong, and nothing else happens', () => {
    let seed = 1;
    const random = (below: number) => {
      seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
      return Math.floor((seed / 2 ** 32) * below);
    };
    let refused = 0;
    for (let round = 0; round < 800; ++round) {
      const file = goldenFile(uris[round % uris.length]);
      const json = new DataView(file.buffer).getUint32(12, true);
      for (let i = 0; i <= random(4); ++i) {
        // Half of them in the JSON, where all the numbers stand.
        const at = random(2) === 0 ? 20 + random(json) : random(file.length);
        file[at] = random(2) === 0 ? 48 + random(10) : random(256);
      }
      try {
        decode(file);
      } catch (error) {
        expect(error).toBeInstanceOf(SceneError);
        ++refused;
      }
    }
    expect(refused).toBeGreaterThan(300);
  }, 60000);
});
