// Decodes volume contents. The bytes are untrusted. docs/tile-format.md, sections 5, 6 and 11.
import { count, emptyTextures, putCube, type Cubes, type MarchedHeader } from '../../raymarch/content';
import { countTextures } from '../../raymarch/content-layout';
import { mismatchWithTileset, ruleOfParts } from '../../raymarch/content-rules';
import { chebyshevDistances } from '../../raymarch/occupancy';
import { PartReader } from '../../raymarch/part-reader';
import { takePlane } from '../../raymarch/texel-pictures';
import type { ContentCodec, DeclaredContent } from '../../tiles/content-codec';
import { kContentLimits, type ContentLimits } from '../../tiles/content-limits';
import type { ContentFile } from '../../tiles/content-reader';
import { getArray, getField, getNumber, getInteger, type Json } from '../../tiles/json-fields';
import { ruleOfNetwork, type DenseLayer } from '../../tiles/network';
import { kDistanceCell, vectorsOfVolume, type VolumeContent, type VolumePart } from './volume-content';
import { layOut, type VolumeLayout } from './volume-layout';
import * as rules from './volume-rules';

// The header of a content; nothing has been allocated for its texels.
export interface VolumeHeader extends MarchedHeader {
  parts: VolumePart[];
  layout: VolumeLayout;
  atlases: number; // textures that the voxel atlas is split into
  featureRange: number;
  densityRange: number;
  stepsPerTexel: number;
  sources: Json[]; // JSON of the parts
  network: DenseLayer[];
  views: Uint8Array[];
}

// readVolumeHeader and decodeVolume throw SceneError that names `name` and the first violated rule; `declared` is what
// tileset.json declares about the content. The image decoder must be prepared (lossless-image.ts).
export function readVolumeHeader(
  file: Uint8Array, name: string, declared?: DeclaredContent, limits = kContentLimits,
): VolumeHeader {
  return new VolumeReader(name, limits).readHeader(file, declared);
}

export function decodeVolume(header: VolumeHeader, name: string): VolumeContent {
  return new VolumeReader(name, kContentLimits).readTexels(header);
}

export const volumeCodec: ContentCodec<VolumeHeader, VolumeContent> = {
  readHeader: readVolumeHeader,
  decode: decodeVolume,
  listBuffers({ planes, voxels, macroblocks, distances }) {
    const arrays = [planes.first, planes.second, voxels.first, voxels.second, macroblocks.texels, distances.texels];
    return arrays.map(({ buffer }) => buffer as ArrayBuffer);
  },
};

class VolumeReader extends PartReader {
  constructor(name: string, limits: ContentLimits) {
    super(name, limits);
  }

  readHeader(file: Uint8Array, declared?: DeclaredContent): VolumeHeader {
    const { ours, views }: ContentFile = this.readFile(file, 'volume');
    const sources = this.readPartSources(ours);
    const parts = sources.map((source, i) => this.readPart(source) ?? this.fail(`part ${i}: its header is not complete`));
    const noRange = 'has no ranges to dequantise with';
    const featureRange = getNumber(ours, 'featureRange') ?? this.fail(noRange);
    const densityRange = getNumber(ours, 'densityRange') ?? this.fail(noRange);
    const stepsPerTexel =
      getField(ours, 'stepsPerTexel') === undefined ? 1 : getInteger(ours, 'stepsPerTexel', rules.kMaxStepsPerTexel);
    if (!stepsPerTexel) this.fail('its steps per texel are out of bounds');
    const network = this.readNetwork(getField(ours, 'network'), views);
    const broken =
      rules.ruleOfRange(featureRange) ?? rules.ruleOfRange(densityRange) ?? ruleOfNetwork(network, rules.kVolumeInputs) ??
      ruleOfParts(parts, rules.ruleOfPart) ?? (declared && mismatchWithTileset(parts, declared));
    if (broken) this.fail(broken);
    const layout = this.laidOut(layOut(parts, this.limits), 16 * vectorsOfVolume({ parts, network }));
    const atlases = countTextures(layout.voxels);
    return {
      memoryBytes: layout.bytes, parts, layout, atlases, featureRange, densityRange, stepsPerTexel, sources, network, views,
    };
  }

  readTexels(header: VolumeHeader): VolumeContent {
    const { parts, layout, atlases, featureRange, densityRange, stepsPerTexel, network, views } = header;
    const planes = emptyTextures(layout.planes);
    const voxels = emptyTextures(layout.voxels.size);
    const macroblocks: Cubes<Uint8Array> = { ...layout.macroblocks, texels: new Uint8Array(4 * count(layout.macroblocks.size)) };
    const distances: Cubes<Uint8Array> = { ...layout.distances, texels: new Uint8Array(count(layout.distances.size)) };
    let begin = 0; // index of the part's first macroblock in the atlas
    parts.forEach((part, n) => {
      const source = header.sources[n];
      const of = (what: string) => `part ${n}: its ${what} are malformed`;
      const { blocks } = layout.voxels;
      if (!this.readMacroblocks(views, source, part.voxels, part.stored, blocks, begin, macroblocks, n, [voxels])) {
        this.fail(of('macroblocks'));
      }
      begin += part.stored;
      const pictures = getArray(source, 'planeTexels');
      const size = { width: part.planes, height: part.planes };
      for (let axis = 0; axis < 3; ++axis) {
        const taken = this.takePictures(views, pictures?.length === 3 ? pictures[axis] : undefined, size,
          (pixels, which) => takePlane(pixels, which, part.planes, planes, 3 * n + axis));
        if (!taken) this.fail(of('planes'));
      }
      const occupied = this.readBits(views, getField(source, 'occupied'), part.planes / kDistanceCell);
      if (!occupied) this.fail(of('occupied cells'));
      putCube(chebyshevDistances(occupied), occupied.edge, distances, n);
    });
    return {
      featureRange, densityRange, stepsPerTexel, network, parts, planes, voxels, atlases, atlasDepth: layout.voxels.depth,
      macroblocks, distances,
    };
  }

  private readPart(source: Json): VolumePart | undefined {
    const place = this.readPlace(source);
    const voxels = getInteger(source, 'voxels', rules.kMaxVoxels);
    const planes = getInteger(source, 'planes', rules.kMaxPlanes);
    return place && voxels !== undefined && planes !== undefined ? { ...place, voxels, planes } : undefined;
  }
}
