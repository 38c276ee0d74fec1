// Decodes mesh contents. The bytes are untrusted. docs/tile-format.md, sections 5, 8 and 11.
import { SceneError } from '../../scene-error';
import type { ContentCodec, ContentHeader, DeclaredContent } from '../../tiles/content-codec';
import { kContentLimits, type ContentLimits } from '../../tiles/content-limits';
import { bufferViewBytes, ContentReader } from '../../tiles/content-reader';
import { getArray, getBoolean, getField, getInteger, getNumber, getNumbers, numberFrom, type Json } from '../../tiles/json-fields';
import { networkVectors } from '../../tiles/network';
import type { SharedResource, Vec3 } from '../../tiles/tileset';
import { decodeTexture, kBc4Bytes, kBc5Bytes } from './block-compression';
import { kCornerNumbers, kFeatures, textureSize, type MeshContent, type MeshPart, type MeshTexels } from './mesh-content';
import * as rules from './mesh-rules';

// The header of a content; nothing has been allocated for its texels.
export interface MeshHeader extends ContentHeader {
  parts: MeshPart[];
  isCompressed: boolean;
  skyEdge: number;
  sky: Json;
  sources: Json[]; // JSON of the parts
  views: Uint8Array[];
  declared?: DeclaredContent;
}

const kBytes = 'application/octet-stream';
const kFeatureTextures = 4; // in BC5, of two features each

// Returns the bytes of a part in memory, as on the GPU.
export function bytesOfPart(part: Pick<MeshPart, 'patches' | 'patchEdge'>, isCompressed: boolean): number {
  const [width, height] = textureSize(part);
  const ofTexel = isCompressed ? (kFeatureTextures * kBc5Bytes + kBc4Bytes) / 16 : kFeatures + 1;
  return 2 * kCornerNumbers * part.patches + ofTexel * width * height;
}

export const meshCodec: ContentCodec<MeshHeader, MeshContent> = {
  overlappingContents: true,
  readHeader: (file, name, declared, limits = kContentLimits) => new MeshReader(name, limits).readHeader(file, declared),
  decode: (header, name) => new MeshReader(name, kContentLimits).readTexels(header),
  listBuffers: ({ texels, sky }) =>
    [...texels.flatMap(({ vertices, features, opacity }) => [vertices, ...features, opacity]), sky].map(({ buffer }) => buffer as ArrayBuffer),
  decodeResource(_, { uri }: SharedResource): never {
    throw new SceneError(uri, '', 'is an encoder, from which the textures of triangles would have to be inferred; the browser cannot do that',
      'bake the scene again with --maps stored');
  },
};

class MeshReader extends ContentReader {
  constructor(name: string, limits: ContentLimits) {
    super(name, limits);
  }

  readHeader(file: Uint8Array, declared?: DeclaredContent): MeshHeader {
    const { ours, views } = this.readFile(file, 'mesh');
    const isBackground = getBoolean(ours, 'background_block') ?? this.fail('background_block is missing or malformed');
    if (declared && declared.backgroundBlock !== isBackground) {
      this.fail(isBackground ? 'it is a background block' : 'it is not a background block');
    }
    const sky = getField(ours, 'sky');
    const skyEdge = sky === undefined ? 0 : (getInteger(sky, 'edge', rules.kMaxSkyEdge) ?? 0);
    if (sky !== undefined && skyEdge < 2) this.fail('the edge of its sky is out of bounds');
    if (skyEdge > 0 && !isBackground) this.fail('it has a sky, but is no background block');
    const sources = getArray(ours, 'parts') ?? [];
    if (sources.length < 1 || sources.length > this.limits.parts) this.fail('has no parts, or too many');
    const isCompressed = this.limits.blockTextures;
    let memoryBytes = 4 * 6 * skyEdge * skyEdge;
    const parts = sources.map((source, n) => {
      const part = this.readPart(source, n, views);
      if (Math.max(...textureSize(part), 6 * skyEdge) > this.limits.edge2D) {
        this.refuse('is more than this GPU takes in one texture', 'draw it on another machine');
      }
      memoryBytes += bytesOfPart(part, isCompressed);
      if (memoryBytes > this.limits.bytes) this.refuse(`takes more than ${this.limits.bytes} bytes of memory`, 'bake smaller blocks');
      return part;
    });
    const vectors = parts.reduce((sum, { network }) => sum + networkVectors(network), 0);
    if (vectors > rules.kMaxVectors) this.fail('the networks of its parts are too large together', 'train with smaller networks');
    return { memoryBytes, parts, isCompressed, skyEdge, sky, sources, views, declared };
  }

  readTexels({ parts, isCompressed, skyEdge, sky, sources, views, declared }: MeshHeader): MeshContent {
    const texels = parts.map((part, n): MeshTexels => {
      const vertices = this.readVertices(part, n, getField(sources[n], 'vertices'), views);
      if (declared && !rules.isInBox(part, vertices, declared)) this.fail(`part ${n} reaches out of the content's box`);
      return { vertices, ...this.readMaps(part, n, sources[n], isCompressed, views) };
    });
    return { isCompressed, parts, texels, skyEdge, sky: this.readSky(skyEdge, sky, views) };
  }

  private readPart(source: Json, n: number, views: Uint8Array[]): MeshPart {
    const fail = (what: string) => this.fail(`part ${n}: ${what}`);
    const patchEdge = getInteger(source, 'patch_edge', rules.kMaxPatchEdge) ?? 0;
    if (patchEdge < rules.kMinPatchEdge || patchEdge % 4 !== 0) fail('its patch_edge is out of bounds');
    const patches = getInteger(source, 'patches', rules.maxPatches(patchEdge)) ?? fail('its patches are out of bounds');
    const pairs = getInteger(source, 'pairs', patches) ?? fail('its pairs are out of bounds');
    const origin = (getNumbers(source, 'origin', 3) ?? fail('its origin is missing or malformed')) as unknown as Vec3;
    const step = getNumber(source, 'step') ?? fail('its step is missing or malformed');
    const ranges = (getArray(source, 'ranges') ?? []).map((ends): [number, number] => {
      const [low, high] = Array.isArray(ends) && ends.length === 2 ? ends.map(numberFrom) : [];
      return low === undefined || high === undefined ? fail('its ranges are missing or malformed') : [Math.fround(low), Math.fround(high)];
    });
    if (ranges.length !== kFeatures) fail('its ranges are missing or malformed');
    const network = this.readNetwork(getField(source, 'network'), views);
    const maps = ['vertices', 'features', 'opacity', 'encoder'].filter((key) => getField(source, key) !== undefined);
    if (maps.includes('encoder')) {
      this.fail(`part ${n}: its textures would have to be inferred; the browser cannot do that`, 'bake the scene again with --maps stored');
    }
    if (maps.length !== (patches === 0 ? 0 : 3)) fail('it has textures or vertices, but no patches, or the other way round');
    const part = { patchEdge, patches, pairs, origin, step, ranges, network };
    const broken = rules.ruleOfPart(part);
    return broken === undefined ? part : fail(broken);
  }

  private readVertices({ patches }: MeshPart, n: number, source: Json, views: Uint8Array[]): Uint16Array {
    const vertices = new Uint16Array(kCornerNumbers * patches);
    if (patches === 0) return vertices;
    const bytes = this.readExactly(source, 2 * vertices.length, views) ?? this.fail(`part ${n}: its vertices are malformed`);
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let i = 0; i < vertices.length; ++i) vertices[i] = view.getUint16(2 * i, true);
    return vertices;
  }

  private readMaps(part: MeshPart, n: number, source: Json, isCompressed: boolean, views: Uint8Array[]): Omit<MeshTexels, 'vertices'> {
    const [width, height] = textureSize(part);
    if (part.patches === 0) return { features: [], opacity: new Uint8Array() };
    const blocks = (width * height) / 16;
    const sources = getArray(source, 'features') ?? [];
    const ofFeatures = sources.map((one) => this.readExactly(one, kBc5Bytes * blocks, views) ?? this.fail(`part ${n}: its features are malformed`));
    if (ofFeatures.length !== kFeatureTextures) this.fail(`part ${n}: its features are malformed`);
    const ofOpacity = this.readExactly(getField(source, 'opacity'), kBc4Bytes * blocks, views) ?? this.fail(`part ${n}: its opacity is malformed`);
    // Copies, because the file's buffer is not transferred.
    if (isCompressed) return { features: ofFeatures.map((one) => one.slice()), opacity: ofOpacity.slice() };
    const features = [new Uint8Array(4 * width * height), new Uint8Array(4 * width * height)];
    ofFeatures.forEach((one, k) => decodeTexture(one, width, height, 2, features[k >> 1], 2 * (k & 1), 4));
    const opacity = new Uint8Array(width * height);
    decodeTexture(ofOpacity, width, height, 1, opacity, 0, 1);
    return { features, opacity };
  }

  private readExactly(source: Json, length: number, views: Uint8Array[]): Uint8Array | undefined {
    const bytes = bufferViewBytes(views, source, kBytes);
    return bytes?.length === length ? bytes : undefined;
  }

  private readSky(edge: number, sky: Json, views: Uint8Array[]): Uint8Array {
    if (edge === 0) return new Uint8Array();
    const pixels = this.readPicture(views, getField(sky, 'texels'), { width: edge, height: 6 * edge }) ?? this.fail('its sky is malformed');
    return new Uint8Array(pixels);
  }
}
