// A volume's content, read: untrusted bytes. docs/tile-format.md, sections 5, 6 and 10.
import { SceneError } from '../scene-error';
import { decodeGlb } from './glb';
import { arrayOf, fieldOf, flagOf, numberOf, numbersOf, stringOf, wholeFrom, wholeOf, type Json } from './json-fields';
import { DecoderFailure, decodeLossless } from './lossless-image';
import { chebyshevDistances, sizeOfBits, takeBits, type OccupancyBits } from './occupancy';
import type { TileContent, Vec3 } from './tileset';
import { kDistanceCell, kMacroblock, vectorsOf, type Cubes, type DenseLayer, type TexelTextures, type VolumeContent, type VolumePart } from './volume-content';
import { kPromisedLimits, layOut, type TextureLimits, type VolumeLayout } from './volume-layout';
import { kTexelPictures, placeInAtlas, sizeOfMacroblocks, takeMacroblocks, takePlane } from './volume-pictures';
import * as rules from './volume-rules';

export const kContentVersion = 1;

export interface VolumeLimits extends TextureLimits {
  fileBytes: number;
  jsonBytes: number;
  bytes: number; // of textures
  parts: number;
}

export const kVolumeLimits: VolumeLimits = {
  ...kPromisedLimits, fileBytes: 2 ** 30, jsonBytes: 2 ** 23, bytes: 2 ** 30, parts: 1024,
};

// What a content says of itself; nothing has been allocated for its texels. `file` is a view of what was given.
export interface VolumeHeader {
  parts: VolumePart[];
  layout: VolumeLayout;
  cardBytes: number; // that its textures and its numbers will take on the graphics card
  featureRange: number;
  densityRange: number;
  stepsPerTexel: number;
  sources: Json[]; // of the parts
  network: DenseLayer[];
  views: Uint8Array[];
}

// Both throw SceneError that names `name` and the first rule that is broken; `promised` is what tileset.json says of
// the content. The decoder of pictures must be prepared (lossless-image.ts).
export function readVolumeHeader(
  file: Uint8Array, name: string, promised?: Pick<TileContent, 'surround' | 'box'>, limits = kVolumeLimits,
): VolumeHeader {
  return new VolumeReader(name, limits).readHeader(file, promised);
}

export function decodeVolume(header: VolumeHeader, name: string): VolumeContent {
  return new VolumeReader(name, kVolumeLimits).readTexels(header);
}

const kExtension = 'TESSERA_content';
const kMostViews = 65536;

class VolumeReader {
  constructor(
    private readonly name: string,
    private readonly limits: VolumeLimits,
  ) {}

  readHeader(file: Uint8Array, promised?: Pick<TileContent, 'surround' | 'box'>): VolumeHeader {
    if (file.length > this.limits.fileBytes) this.fail('is larger than any content should be');
    const glb = decodeGlb(file) ?? this.fail('is no binary glTF 2.0 file');
    if (glb.json.length > this.limits.jsonBytes) this.fail("its JSON is larger than any content's should be");
    let asset: Json;
    try {
      asset = JSON.parse(new TextDecoder().decode(glb.json));
    } catch {
      this.fail('its JSON is none');
    }
    const ours = this.readAsset(asset);
    const views = this.readViews(asset, glb.bytes);
    const sources = arrayOf(ours, 'parts') ?? [];
    if (sources.length < 1 || sources.length > this.limits.parts) this.fail('has no parts, or too many');
    const parts = sources.map((source, i) => this.readPart(source, `part ${i}`));
    const noRange = 'has no ranges to dequantise with';
    const featureRange = numberOf(ours, 'featureRange') ?? this.fail(noRange);
    const densityRange = numberOf(ours, 'densityRange') ?? this.fail(noRange);
    const stepsPerTexel =
      fieldOf(ours, 'stepsPerTexel') === undefined ? 1 : wholeOf(ours, 'stepsPerTexel', rules.kMostStepsPerTexel);
    if (!stepsPerTexel) this.fail('its steps per texel are out of bounds');
    const network = this.readNetwork(fieldOf(ours, 'network'), views);
    const broken =
      rules.ruleOfRange(featureRange) ?? rules.ruleOfRange(densityRange) ?? rules.ruleOfNetwork(network) ??
      rules.ruleOfParts(parts) ?? (promised && rules.brokenPromise(parts, promised));
    if (broken) this.fail(broken);
    const uniformBytes = 16 * vectorsOf(parts.length, network);
    if (uniformBytes > this.limits.uniformBytes) {
      this.fail('has more parts, or a larger network, than this graphics card takes', 'draw it on another machine');
    }
    const layout = layOut(parts, this.limits);
    if (!layout) {
      this.fail('is more than this graphics card takes in one texture', 'draw a coarser level, or bake smaller blocks');
    }
    if (layout.bytes > this.limits.bytes) this.fail(`takes more than ${this.limits.bytes} bytes of memory`);
    const cardBytes = layout.bytes + uniformBytes;
    return { parts, layout, cardBytes, featureRange, densityRange, stepsPerTexel, sources, network, views };
  }

  readTexels(header: VolumeHeader): VolumeContent {
    const { parts, layout, featureRange, densityRange, stepsPerTexel, network } = header;
    const planes = emptyTextures(layout.planes);
    const voxels = emptyTextures(layout.voxels);
    const macroblocks: Cubes<Uint8Array> = { ...layout.macroblocks, texels: new Uint8Array(4 * count(layout.macroblocks.size)) };
    const distances: Cubes<Uint8Array> = { ...layout.distances, texels: new Uint8Array(count(layout.distances.size)) };
    let begin = 0; // of the part's macroblocks in the atlas
    parts.forEach((part, n) => {
      const source = header.sources[n];
      const of = (what: string) => `part ${n}: its ${what} are not what they should be`;
      const alive = this.readBits(header, fieldOf(fieldOf(source, 'macroblocks'), 'alive'), part.voxels / kMacroblock);
      if (!alive || !this.readMacroblocks(header, source, part, alive, voxels, macroblocks, n, begin)) {
        this.fail(of('macroblocks'));
      }
      begin += part.stored;
      const pictures = arrayOf(source, 'planeTexels');
      for (let axis = 0; axis < 3; ++axis) {
        const taken = this.takePictures(header, pictures?.length === 3 ? pictures[axis] : undefined, part.planes, part.planes,
          (pixels, which) => takePlane(pixels, which, part.planes, planes, 3 * n + axis));
        if (!taken) this.fail(of('planes'));
      }
      const occupied = this.readBits(header, fieldOf(source, 'occupied'), part.planes / kDistanceCell);
      if (!occupied) this.fail(of('occupied cells'));
      putCube(chebyshevDistances(occupied), occupied.edge, distances, n);
    });
    return { featureRange, densityRange, stepsPerTexel, network, parts, planes, voxels, atlasDepth: layout.atlasDepth, macroblocks, distances };
  }

  private fail(reason: string, remedy = 'copy the scene again, or bake it again'): never {
    throw new SceneError(this.name, '', reason, remedy);
  }

  private readAsset(asset: Json): Json {
    if (stringOf(fieldOf(asset, 'asset'), 'version') !== '2.0') this.fail('its JSON is not that of a glTF 2.0 asset');
    const ours = fieldOf(fieldOf(asset, 'extensions'), kExtension);
    if (ours === undefined || !arrayOf(asset, 'extensionsUsed')?.includes(kExtension)) {
      this.fail(`has no extension ${kExtension}`);
    }
    const version = wholeOf(ours, 'version') ?? this.fail('does not say which version it is of');
    if (version !== kContentVersion) this.fail(`is of version ${version}; ${kContentVersion} is known`);
    if (stringOf(ours, 'representation') !== 'volume') this.fail('is not of the representation volume');
    return ours;
  }

  private readViews(asset: Json, bytes: Uint8Array): Uint8Array[] {
    const outside = 'its buffer views do not lie within its bytes';
    const buffers = arrayOf(asset, 'buffers') ?? [];
    const length = wholeOf(buffers[0], 'byteLength') ?? -1;
    if (buffers.length !== 1 || fieldOf(buffers[0], 'uri') !== undefined) this.fail(outside);
    if (length < 0 || length > bytes.length || bytes.length - length > 3) this.fail(outside);
    const views = arrayOf(asset, 'bufferViews') ?? this.fail(outside);
    if (views.length > kMostViews) this.fail(outside);
    return views.map((view) => {
      const size = wholeOf(view, 'byteLength');
      const offset = fieldOf(view, 'byteOffset') === undefined ? 0 : wholeOf(view, 'byteOffset');
      if (wholeOf(view, 'buffer') !== 0 || size === undefined || offset === undefined || offset + size > length) {
        this.fail(outside);
      }
      return bytes.subarray(offset, offset + size);
    });
  }

  private readPart(source: Json, place: string): VolumePart {
    const incomplete = `${place}: its header is not complete`;
    const triple = (key: string): Vec3 => {
      const numbers = numbersOf(source, key, 3) ?? this.fail(incomplete);
      return numbers.map(Math.fround) as unknown as Vec3;
    };
    const fields = {
      centre: triple('centre'), scale: triple('scale'), low: triple('low'), high: triple('high'),
      contracted: flagOf(source, 'contracted'), surround: flagOf(source, 'surround'),
      voxels: wholeOf(source, 'voxels', rules.kMostVoxels), planes: wholeOf(source, 'planes', rules.kMostPlanes),
      stored: wholeOf(fieldOf(source, 'macroblocks'), 'stored', rules.kMostStored),
    };
    if (Object.values(fields).includes(undefined)) this.fail(incomplete);
    return fields as VolumePart;
  }

  private readNetwork(source: Json, views: Uint8Array[]): DenseLayer[] {
    const layers = arrayOf(source, 'layers') ?? this.fail('has no network');
    const bytes = viewOf(views, source, 'application/octet-stream') ?? this.fail('has no network');
    if (layers.length > rules.kMostLayers) this.fail('the network has too many layers');
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    let at = 0;
    const take = (numbers: number) => {
      if (bytes.length - at < 4 * numbers) this.fail('the network has fewer numbers than its layers need');
      const taken = new Float32Array(numbers);
      for (let i = 0; i < numbers; ++i, at += 4) taken[i] = view.getFloat32(at, true);
      return taken;
    };
    const network = layers.map((sides): DenseLayer => {
      const side = (i: number) => (Array.isArray(sides) && sides.length === 2 ? wholeFrom(sides[i], rules.kMostLayerWidth) : undefined);
      const inputs = side(0) ?? this.fail('a layer of the network is out of bounds');
      const outputs = side(1) ?? this.fail('a layer of the network is out of bounds');
      return { inputs, outputs, weights: take(inputs * outputs), biases: take(outputs) };
    });
    if (at !== bytes.length) this.fail('the network has more numbers than its layers need');
    return network;
  }

  private readMacroblocks(
    header: VolumeHeader, source: Json, part: VolumePart, alive: OccupancyBits, voxels: TexelTextures,
    macroblocks: Cubes<Uint8Array>, n: number, begin: number,
  ): boolean {
    const { atlas } = header.layout;
    const places = new Uint8Array(4 * alive.bits.length);
    let number = 0;
    alive.bits.forEach((bit, cell) => {
      if (bit) places.set([...placeInAtlas(begin + number++, atlas), 1], 4 * cell);
    });
    if (number !== part.stored) return false;
    putCube(places, alive.edge, macroblocks, n, 4);
    if (part.stored === 0) return true;
    const { width, height } = sizeOfMacroblocks(part.stored);
    return this.takePictures(header, fieldOf(fieldOf(source, 'macroblocks'), 'texels'), width, height,
      (pixels, which) => takeMacroblocks(pixels, which, part.stored, voxels, atlas, begin));
  }

  private takePictures(
    header: VolumeHeader, sources: Json, width: number, height: number,
    take: (pixels: Uint8ClampedArray, which: number) => boolean,
  ): boolean {
    if (!Array.isArray(sources) || sources.length !== kTexelPictures) return false;
    return sources.every((source, which) => {
      const pixels = this.readPicture(header, source, width, height);
      return pixels !== undefined && take(pixels, which);
    });
  }

  private readBits(header: VolumeHeader, source: Json, edge: number): OccupancyBits | undefined {
    const { width, height } = sizeOfBits(edge ** 3);
    const pixels = this.readPicture(header, source, width, height);
    return pixels && takeBits(pixels, edge);
  }

  private readPicture(header: VolumeHeader, source: Json, width: number, height: number): Uint8ClampedArray | undefined {
    const bytes = viewOf(header.views, source, 'image/webp');
    try {
      return bytes && decodeLossless(bytes, width, height);
    } catch (error) {
      if (!(error instanceof DecoderFailure)) throw error;
      this.fail('is more than the decoder of pictures has memory for', 'close other pages, or copy the scene again');
    }
  }
}

function viewOf(views: Uint8Array[], source: Json, mimeType: string): Uint8Array | undefined {
  const index = wholeOf(source, 'bufferView');
  return index !== undefined && stringOf(source, 'mimeType') === mimeType ? views[index] : undefined;
}

function count(size: Vec3): number {
  return size[0] * size[1] * size[2];
}

function emptyTextures(size: Vec3): TexelTextures {
  return { size, first: new Uint8Array(4 * count(size)), second: new Uint8Array(4 * count(size)) };
}

function putCube(from: Uint8Array, edge: number, to: Cubes<Uint8Array>, n: number, bytes = 1): void {
  const [x0, y0, z0] = to.origins[n];
  for (let z = 0; z < edge; ++z) {
    for (let y = 0; y < edge; ++y) {
      const row = bytes * edge * (y + edge * z);
      to.texels.set(from.subarray(row, row + bytes * edge), bytes * (x0 + to.size[0] * (y0 + y + to.size[1] * (z0 + z))));
    }
  }
}
