// One content of a `volume` scene in memory, laid out as graphics cards take it. docs/tile-format.md, section 6, is
// normative for what it means. A sample that turns out to be empty has cost half its lookups: the first of two textures.
import type { ContentPart, Cubes, TexelTextures } from '../../raymarch/content';
import { networkVectors, type DenseLayer } from '../../tiles/network';

export const kDistanceCell = 8; // plane texels along an edge of a cell of `distances`

// A part's texels lie in the content's textures: its planes are the layers 3n, 3n + 1, 3n + 2, n being its number.
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
  planes: TexelTextures; // layer after layer; a part with fewer texels than the largest lies in the corner of its layers
  voxels: TexelTextures; // an atlas of macroblocks of 9³; no texels where no part stores any
  atlases: number; // textures that it is cut into
  atlasDepth: number; // texels of the atlas that one texture has, at most
  // Where a macroblock lies in the atlas, in macroblocks: [z][y][x][4], the fourth 1 where it is stored, else all 0.
  macroblocks: Cubes<Uint8Array>;
  // Of each cell how many cells away the nearest occupied one is, in any direction, 255 at most.
  distances: Cubes<Uint8Array>;
}

// Vectors of four numbers that shaders are given: of each part, then of the network.
export const kVectorsOfPart = 6;

export function vectorsOfVolume({ parts, network }: Pick<VolumeContent, 'parts' | 'network'>): number {
  return kVectorsOfPart * parts.length + networkVectors(network);
}
