// One content of a `volume` scene in memory, laid out as graphics cards take it. docs/tile-format.md, section 6, is
// normative for what it means.
//
// A texel has 8 attributes, which stand in two textures of 4 bytes: the first holds diffuse red, green, blue and
// density, the second the 4 features. So a sample that turns out to be empty has cost half its lookups.
import type { Vec3 } from './tileset';

export const kMacroblock = 8; // voxels along an edge
export const kStoredEdge = 9; // and one more at the upper end: the apron
export const kDistanceCell = 8; // plane texels along an edge of a cell of `distances`

export interface DenseLayer {
  inputs: number;
  outputs: number;
  weights: Float32Array; // [outputs][inputs]
  biases: Float32Array; // [outputs]
}

// A part's texels lie in the content's textures: its planes are the layers 3n, 3n + 1, 3n + 2, n being its number.
export interface VolumePart {
  centre: Vec3;
  scale: Vec3;
  contracted: boolean;
  surround: boolean;
  low: Vec3; // what it owns, scene units
  high: Vec3;
  voxels: number; // along an axis
  planes: number;
  stored: number; // macroblocks
}

// A texture of three dimensions, x fastest, that holds one cube of each part. Part n's begins at origins[n].
export interface Cubes<Texels> {
  size: Vec3;
  origins: Vec3[];
  texels: Texels;
}

export interface TexelTextures {
  size: Vec3; // texels
  first: Uint8Array; // [z][y][x][4]
  second: Uint8Array;
}

export interface VolumeContent {
  featureRange: number;
  densityRange: number;
  stepsPerTexel: number;
  network: DenseLayer[];
  parts: VolumePart[];
  planes: TexelTextures; // layer after layer; a part with fewer texels than the largest lies in the corner of its layers
  voxels: TexelTextures; // an atlas of macroblocks of 9³; no texels where no part stores any
  atlasDepth: number; // texels of the atlas that one texture has, at most
  // Where a macroblock lies in the atlas, in macroblocks: [z][y][x][4], the fourth 1 where it is stored, else all 0.
  macroblocks: Cubes<Uint8Array>;
  // Of each cell how many cells away the nearest occupied one is, in any direction, 255 at most.
  distances: Cubes<Uint8Array>;
}

// Vectors of four numbers that shaders are given of a content: of each part, and of each four outputs of a layer
// together their biases and a vector for each input.
export const kVectorsOfPart = 6;

export function vectorsOf(parts: number, network: Pick<DenseLayer, 'inputs' | 'outputs'>[]): number {
  return network.reduce((sum, layer) => sum + Math.ceil(layer.outputs / 4) * (1 + layer.inputs), kVectorsOfPart * parts);
}
