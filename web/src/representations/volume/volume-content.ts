// One content of a `volume` scene in memory, in the layout that the GPU uses. docs/tile-format.md, section 6, is
// normative for its meaning. A sample that turns out to be empty costs only half of the lookups: those in the first of
// two textures.
import type { ContentPart, Cubes, TexelTextures } from '../../raymarch/content';
import { networkVectors, type DenseLayer } from '../../tiles/network';

export const kDistanceCell = 8; // plane texels along an edge of a cell of `distances`

// The planes of part n are the layers 3n, 3n + 1 and 3n + 2 of the content's textures.
export interface VolumePart extends ContentPart {
  voxels: number; // along an axis
  planes: number;
}

export interface VolumeContent {
  featureRange: number;
  densityRange: number;
  stepsPerTexel: number;
  network: DenseLayer[];
  parts: VolumePart[];
  planes: TexelTextures; // layer after layer; a part with fewer texels than the largest occupies the corner of its layers
  voxels: TexelTextures; // an atlas of macroblocks of 9³; without texels if no part stores any
  atlases: number; // textures that the atlas is split into
  atlasDepth: number; // layers of one texture, at most
  // The place of each macroblock in the atlas, in macroblocks: [z][y][x][4], the fourth is 1 if it is stored, else all
  // are 0.
  macroblocks: Cubes<Uint8Array>;
  // The Chebyshev distance of each cell to the nearest occupied one, in cells, at most 255.
  distances: Cubes<Uint8Array>;
}

// Numbers of vec4s that shaders get: for each part, then for the network.
export const kVectorsOfPart = 6;

export function vectorsOfVolume({ parts, network }: Pick<VolumeContent, 'parts' | 'network'>): number {
  return kVectorsOfPart * parts.length + networkVectors(network);
}
