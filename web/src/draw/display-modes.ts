// The display modes: what is shown of a scene. A representation's drawer lists these first, then its own.
import * as THREE from 'three';

export interface ShownMode<Name extends string = string> {
  name: Name;
  label: string; // for users
  // The mode shows one feature level of the contents: any level, or only a fine one, from 1 on.
  featureLevel?: 'any' | 'fine';
}

export const kSharedModes = [
  { name: 'colour', label: 'Colour' }, { name: 'diffuse', label: 'Without reflections' }, { name: 'specular', label: 'Reflections alone' },
  { name: 'features', label: 'Features' }, { name: 'depth', label: 'Distance' }, { name: 'blocks', label: 'Blocks' },
  { name: 'levels', label: 'Levels of detail' },
] as const satisfies readonly ShownMode[];

// Returns `const int kShowDiffuse = 1; …` for shaders: the indices in the list of modes.
export function displayConstants(modes: readonly ShownMode[]): string {
  return modes.map(({ name }, i) => `const int kShow${name.charAt(0).toUpperCase()}${name.slice(1)} = ${i};`).join('\n');
}

// The constants of the modes that every drawer lists first.
export const kDisplayConstants = displayConstants(kSharedModes);

// Neighbours in the tree have consecutive numbers; hues that differ by the golden angle distinguish them.
export function colourOfBlock(number: number): THREE.Color {
  return new THREE.Color().setHSL((number * 0.381966) % 1, 0.65, 0.6, THREE.LinearSRGBColorSpace);
}

// Ranges from green, for the finest level, to red.
export function colourOfLevel(level: number): THREE.Color {
  return new THREE.Color().setHSL(Math.max(0, 0.36 - 0.12 * level), 0.7, 0.55, THREE.LinearSRGBColorSpace);
}
