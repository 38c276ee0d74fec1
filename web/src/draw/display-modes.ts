// What of the scene is shown. A representation's drawer says which modes it has: these, and then its own.
import * as THREE from 'three';

export interface ShownMode<Name extends string = string> {
  name: Name;
  label: string; // for people
  // Shows one of the levels of features that its contents have: any of them, or the fine ones, from 1 on.
  featureLevel?: 'any' | 'fine';
}

export const kSharedModes = [
  { name: 'colour', label: 'Colour' }, { name: 'diffuse', label: 'Without reflections' }, { name: 'specular', label: 'Reflections alone' },
  { name: 'features', label: 'Features' }, { name: 'depth', label: 'Distance' }, { name: 'blocks', label: 'Blocks' },
  { name: 'levels', label: 'Levels of detail' },
] as const satisfies readonly ShownMode[];

// `const int kShowDiffuse = 1; …` for shaders: numbers in the list of modes.
export function displayConstants(modes: readonly ShownMode[]): string {
  return modes.map(({ name }, i) => `const int kShow${name.charAt(0).toUpperCase()}${name.slice(1)} = ${i};`).join('\n');
}

// Of those that every drawer has first.
export const kDisplayConstants = displayConstants(kSharedModes);

// Neighbours in the tree have numbers that follow one another: hues a golden angle apart tell them apart.
export function colourOfBlock(number: number): THREE.Color {
  return new THREE.Color().setHSL((number * 0.381966) % 1, 0.65, 0.6, THREE.LinearSRGBColorSpace);
}

// From green, the finest, to red.
export function colourOfLevel(level: number): THREE.Color {
  return new THREE.Color().setHSL(Math.max(0, 0.36 - 0.12 * level), 0.7, 0.55, THREE.LinearSRGBColorSpace);
}
