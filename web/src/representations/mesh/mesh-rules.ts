// The rules for mesh contents: docs/tile-format.md, section 8. Each function returns the first violation as text for
// users.
import type { DeclaredContent } from '../../tiles/content-codec';
import { ruleOfNetwork } from '../../tiles/network';
import type { Broken } from '../../tiles/tileset-rules';
import { kCornerNumbers, kFeatures, type MeshPart } from './mesh-content';

export const kMinPatchEdge = 4;
export const kMaxPatchEdge = 32;
export const kMaxTextureEdge = 4096;
export const kMaxSkyEdge = 1024;
export const kMaxVectors = 2 ** 18; // of four numbers, of the networks of a content
const kHarmonics = 9; // of the direction
const kFarthestVertex = 1e7; // scene units
const kLargestStep = 152;
const kLargestFeature = 1e6;
const kBoxTolerance = 1e-6; // of the larger of 1 and the box's coordinate

// At most 2^18, so that single precision suffices for the numbers of patches.
export function maxPatches(patchEdge: number): number {
  return Math.floor(kMaxTextureEdge / Math.max(patchEdge, 8)) ** 2;
}

export function ruleOfPart({ origin, step, ranges, network }: MeshPart): Broken {
  if (!(step >= 1e-12 && step <= kLargestStep)) return 'its step is out of bounds';
  if (!origin.every((x) => Math.abs(x) <= kFarthestVertex)) return 'its origin is out of bounds';
  const isRange = ([low, high]: readonly [number, number]) => low >= -kLargestFeature && low <= high && high <= kLargestFeature;
  if (!ranges.every(isRange)) return 'a range is out of bounds';
  return ruleOfNetwork(network, kFeatures + kHarmonics);
}

// Tests that the vertices lie in the box that tileset.json declares.
export function isInBox({ patches, pairs, origin, step }: MeshPart, vertices: Uint16Array, { box }: DeclaredContent): boolean {
  const tolerance = (x: number) => kBoxTolerance * Math.max(1, Math.abs(x));
  const low = box.low.map((x) => x - tolerance(x));
  const high = box.high.map((x) => x + tolerance(x));
  for (let patch = 0; patch < patches; ++patch) {
    // Corner 3 of a patch with one triangle has no meaning.
    const numbers = patch < pairs ? kCornerNumbers : kCornerNumbers - 3;
    for (let i = 0; i < numbers; ++i) {
      const x = origin[i % 3] + step * vertices[kCornerNumbers * patch + i];
      if (x < low[i % 3] || x > high[i % 3]) return false;
    }
  }
  return true;
}
