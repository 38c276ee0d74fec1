import { beforeAll, describe, expect, it } from 'vitest';
import { decodeAny, Sum, testContentReader } from '../../testing/content-tests';
import { goldenFile, goldenText, prepareDecoderInNode } from '../../testing/golden';
import { kCodecs } from '../codecs';
import { decodeTileset } from '../../tiles/decode-tileset';
import { kContentLimits } from '../../tiles/content-limits';
import { bytesOfPart, meshCodec } from './decode-mesh';
import { textureSize, type MeshContent } from './mesh-content';

interface Sums {
  patches: number;
  pairs: number;
  vertices: number;
  verticesOrdered: number;
  features: number;
  featuresOrdered: number;
  opacity: number;
  opacityOrdered: number;
}

const sums = JSON.parse(goldenText('sums.json', 'mesh')) as Record<string, Sums[]>;
const uris = Object.keys(sums);
const kBlocks = { ...kContentLimits, blockTextures: true };

beforeAll(prepareDecoderInNode);

// Returns a file whose JSON has another text of the same length.
function withJson(file: Uint8Array, from: string, to: string): Uint8Array {
  expect(to.length).toBe(from.length);
  const changed = Buffer.from(file);
  const at = changed.indexOf(from);
  expect(at).toBeGreaterThan(0);
  changed.write(to, at);
  return new Uint8Array(changed);
}

describe('decodeMesh', () => {
  it.each(uris)('decodes the golden scene to its checksums: %s', (uri) => {
    const { parts, texels } = decodeAny('mesh', goldenFile(uri, 'mesh'), kBlocks) as MeshContent;
    const sumBytes = (arrays: Uint8Array[]) => {
      const sum = new Sum();
      for (const bytes of arrays) sum.add(bytes);
      return sum;
    };
    expect(parts.map(({ patches, pairs }, n) => {
      const { vertices, features, opacity } = texels[n];
      const [ofVertices, ofFeatures, ofOpacity] = [[new Uint8Array(vertices.buffer)], features, [opacity]].map(sumBytes);
      return {
        patches, pairs, vertices: ofVertices.plain, verticesOrdered: ofVertices.ordered, features: ofFeatures.plain,
        featuresOrdered: ofFeatures.ordered, opacity: ofOpacity.plain, opacityOrdered: ofOpacity.ordered,
      };
    })).toEqual(sums[uri]);
  });

  testContentReader('mesh', uris);

  it('gives bytes to GPUs that sample no compressed textures', () => {
    const file = goldenFile(uris[0], 'mesh');
    const { parts, texels, isCompressed } = decodeAny('mesh', file) as MeshContent;
    expect(isCompressed).toBe(false);
    parts.forEach((part, n) => {
      const [width, height] = textureSize(part);
      expect(texels[n].features.map(({ length }) => length)).toEqual([4 * width * height, 4 * width * height]);
      expect(texels[n].opacity.length).toBe(width * height);
      expect(bytesOfPart(part, false) - bytesOfPart(part, true)).toBe(4.5 * width * height);
    });
  });

  it('rejects contents that exceed the memory limit or the size of a texture', () => {
    const file = goldenFile(uris[0], 'mesh');
    const { memoryBytes } = meshCodec.readHeader(file, 'a');
    expect(() => meshCodec.readHeader(file, 'a', undefined, { ...kContentLimits, bytes: memoryBytes - 1 })).toThrow('bytes of memory');
    expect(() => meshCodec.readHeader(file, 'a', undefined, { ...kContentLimits, edge2D: 32 })).toThrow('in one texture');
  });

  it('rejects a content that differs from what tileset.json declares', () => {
    const { tiles } = decodeTileset(goldenText('tileset.json', 'mesh'), 'tileset.json', kCodecs);
    for (const declared of tiles.flatMap(({ contents }) => contents)) {
      const file = goldenFile(declared.uri, 'mesh');
      const decode = (one: typeof declared) => meshCodec.decode(meshCodec.readHeader(file, 'a', one), 'a', []);
      expect(() => decode(declared)).not.toThrow();
      expect(() => decode({ ...declared, backgroundBlock: !declared.backgroundBlock })).toThrow('background block');
      const { low, high } = declared.box;
      expect(() => decode({ ...declared, box: { low, high: [high[0], high[1], 0.5 * (low[2] + high[2])] } })).toThrow("out of the content's box");
    }
  });

  it('names what is out of bounds', () => {
    const file = goldenFile(uris[0], 'mesh');
    const read = (from: string, to: string) => () => decodeAny('mesh', withJson(file, from, to));
    expect(read('"patch_edge":8', '"patch_edge":7')).toThrow('part 0: its patch_edge');
    expect(read('"patches":38', '"patches":39')).toThrow('part 0: its vertices');
    expect(read('"pairs":26', '"pairs":99')).toThrow('part 0: its pairs');
    expect(read('"vertices"', '"Vertices"')).toThrow('part 0: it has textures or vertices, but no patches');
  });

  it('says how to bake scenes whose textures are not stored', () => {
    expect(() => meshCodec.decodeResource!(new Uint8Array(), { uri: 'resources/a.glb', mimeType: '', bytes: 0 }, kContentLimits)).toThrow('--maps stored');
  });
});
