// One content of a `hash` scene in memory, in the layout that the GPU uses. docs/tile-format.md, section 7, is
// normative for its meaning.
import { kAttributes, type ContentPart, type Cubes, type TexelTextures } from '../../raymarch/content';
import type { DenseLayer } from '../../tiles/network';

export const kMaxTables = 8;

// The range that a byte encodes linearly, from low (0) to high (255).
export interface ByteRange {
  low: number;
  high: number;
}

export interface HashTable {
  resolution: number;
  entries: number;
  hashed: boolean;
  ranges: ByteRange[]; // of its 8 features
}

export interface HashPart extends ContentPart {
  lattice: number; // corners along an axis
  ranges: ByteRange[]; // of the columns of its corners
  tables: HashTable[];
  cells: number; // along an axis
  nearCells: number; // number of occupied coarse cells of OctantDistanceField; 0 if there is only one grid
}

// What weights a fine level: nothing, one number for all features, or one for density and one for the other features.
export const kLevelWeights = ['none', 'shared', 'separate'] as const;
export type LevelWeights = (typeof kLevelWeights)[number];

// The settings that all parts of a content share.
export interface HashSettings {
  weights: LevelWeights;
  logits?: number[]; // if the weights are the same everywhere
  step: number; // step of a ray as a fraction of a domain's width
  hasLearnedBackground: boolean;
}

export interface HashContent {
  settings: HashSettings;
  network: DenseLayer[];
  parts: HashPart[];
  // One atlas of macroblocks of 9³ corners for every eight columns; it has no texels if no part stores any.
  corners: TexelTextures[];
  atlases: number; // textures that an atlas is split into
  atlasDepth: number; // layers of one texture, at most
  macroblocks: Cubes<Uint8Array>; // see VolumeContent.macroblocks
  distances: Cubes<Uint32Array>; // coarse grids of OctantDistanceField
  nearDistances: List; // fine cells of OctantDistanceField, one word each, one list per part
  tables: List; // entries of 8 bytes as 2 words, one list per table
}

// Lists one after another, each of which begins a new row: [layer][row][kLengthOfRow][1 or 2 words].
export interface List {
  rows: number; // in a layer
  layers: number;
  firstRows: number[]; // first row of each list, counted through all layers
  words: Uint32Array;
}

export const kLengthOfRow = 2048;
export const kRowsOfLayer = 2048; // at most

export function logitsOfLevel(weights: LevelWeights): number {
  return kLevelWeights.indexOf(weights);
}

// Returns the number of columns of each of a part's corners.
export function countColumns({ weights, logits }: HashSettings): number {
  return weights === 'none' || logits ? kAttributes : 2 * kAttributes;
}

// Numbers of vec4s that shaders get for each part: its place, the ranges of its columns, and its tables.
export const kVectorsOfPlace = 6;
export const kVectorsOfTable = 5;

export function vectorsOfPart(columns: number, tables: number): number {
  return kVectorsOfPlace + columns / 2 + kVectorsOfTable * tables;
}

export function vectorsOfHash({ parts, settings }: Pick<HashContent, 'parts' | 'settings'>): number {
  return vectorsOfPart(countColumns(settings), parts[0].tables.length) * parts.length;
}
