// One content of a `hash` scene in memory, laid out as graphics cards take it. docs/tile-format.md, section 7, is normative
// for what it means.
import { kAttributes, type ContentPart, type Cubes, type TexelTextures } from '../../raymarch/content';
import type { DenseLayer } from '../../tiles/network';

export const kMostTables = 8;

// What a byte stands for: evenly from low (0) to high (255).
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
  nearCells: number; // of OctantDistances, coarse ones that hold something; 0 where there is one grid alone
}

// What weighs a fine level: nothing, a number for all features, or one for density and one for the rest.
export const kLevelWeights = ['none', 'shared', 'separate'] as const;
export type LevelWeights = (typeof kLevelWeights)[number];

// What all that is made of a content depends on.
export interface HashSettings {
  weights: LevelWeights;
  logits?: number[]; // where weights are the same everywhere
  step: number; // of a ray, as a share of a domain's width
  whole: boolean;
}

export interface HashContent {
  settings: HashSettings;
  network: DenseLayer[];
  parts: HashPart[];
  // An atlas of macroblocks of 9³ corners, for each eight columns: no texels where no part stores any.
  corners: TexelTextures[];
  atlases: number; // textures that it is cut into
  atlasDepth: number; // texels of the atlas that one texture has, at most
  macroblocks: Cubes<Uint8Array>; // as VolumeContent's
  distances: Cubes<Uint32Array>; // OctantDistances' coarse grids
  nearDistances: List; // and their fine cells, a word each, a list a part
  tables: List; // their entries, of which 8 bytes are 2 words, a list a table
}

// Lists one after another, each beginning a row: [layer][row][kLengthOfRow][1 or 2 words].
export interface List {
  rows: number; // of a layer
  layers: number;
  rowOf: number[]; // of each list the first row, counted through all layers
  words: Uint32Array;
}

export const kLengthOfRow = 2048;
export const kRowsOfLayer = 2048; // at most

export function logitsOfLevel(weights: LevelWeights): number {
  return kLevelWeights.indexOf(weights);
}

// Of a part's corners.
export function columnsOf({ weights, logits }: HashSettings): number {
  return weights === 'none' || logits ? kAttributes : 2 * kAttributes;
}

// Vectors of four numbers that shaders are given of each part: its place, the ranges of its columns, and its tables.
export const kVectorsOfPlace = 6;
export const kVectorsOfTable = 5;

export function vectorsOfPart(columns: number, tables: number): number {
  return kVectorsOfPlace + columns / 2 + kVectorsOfTable * tables;
}

export function vectorsOfHash({ parts, settings }: Pick<HashContent, 'parts' | 'settings'>): number {
  return vectorsOfPart(columnsOf(settings), parts[0].tables.length) * parts.length;
}
