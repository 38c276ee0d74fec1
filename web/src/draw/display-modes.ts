// What of the scene is shown.
import * as THREE from 'three';
import { kMostTables } from '../tiles/hash-content';
import type { Representation } from '../tiles/tileset';

export const kDisplayModes = [
  'colour', 'diffuse', 'specular', 'features', 'depth', 'blocks', 'levels', 'contribution', 'attention', 'densityAttention',
] as const;
export type DisplayMode = (typeof kDisplayModes)[number];

// Those that show one of the levels of features that scenes of `hash` have (NGP-RT, figures 6 and S2): what it alone gives to the
// colour, and what it is weighed with, for colours and for density.
const kOfFeatureLevel: readonly DisplayMode[] = ['contribution', 'attention', 'densityAttention'];

export const kMostFeatureLevels = kMostTables; // fine ones

export function isOfFeatureLevel(mode: DisplayMode): boolean {
  return kOfFeatureLevel.includes(mode);
}

export function displayModesOf(representation: Representation): DisplayMode[] {
  return kDisplayModes.filter((mode) => representation === 'hash' || !isOfFeatureLevel(mode));
}

// `const int kShowDiffuse = 1; …` for shaders.
export const kDisplayConstants = kDisplayModes
  .map((mode, i) => `const int kShow${mode.charAt(0).toUpperCase()}${mode.slice(1)} = ${i};`)
  .join('\n');

// Neighbours in the tree have numbers that follow one another: hues a golden angle apart tell them apart.
export function colourOfBlock(number: number): THREE.Color {
  return new THREE.Color().setHSL((number * 0.381966) % 1, 0.65, 0.6, THREE.LinearSRGBColorSpace);
}

// From green, the finest, to red.
export function colourOfLevel(level: number): THREE.Color {
  return new THREE.Color().setHSL(Math.max(0, 0.36 - 0.12 * level), 0.7, 0.55, THREE.LinearSRGBColorSpace);
}
