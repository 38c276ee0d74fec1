// Chunks of consecutive patches, so that those outside of a picture are not drawn. Patches that follow one another are
// near one another in our scenes (docs/tile-format.md, section 8), so chunks are small.
import * as THREE from 'three';
import type { Box, Vec3 } from '../../tiles/tileset';
import { kCornerNumbers, type MeshPart } from './mesh-content';

const kPatchesOfChunk = 256;

export interface PatchChunk {
  first: number; // patch
  patches: number;
  low: Vec3; // of the numbers of its vertices
  high: Vec3;
}

// A run of patches to draw.
export interface PatchRun {
  first: number;
  patches: number;
}

// `vertices` are those of patchGeometry: corner 3 of each patch has a meaning.
export function makeChunks(vertices: Uint16Array): PatchChunk[] {
  const patches = vertices.length / kCornerNumbers;
  const chunks: PatchChunk[] = [];
  for (let first = 0; first < patches; first += kPatchesOfChunk) {
    const count = Math.min(kPatchesOfChunk, patches - first);
    const low: [number, number, number] = [65535, 65535, 65535];
    const high: [number, number, number] = [0, 0, 0];
    for (let i = kCornerNumbers * first; i < kCornerNumbers * (first + count); ++i) {
      const axis = i % 3;
      if (vertices[i] < low[axis]) low[axis] = vertices[i];
      if (vertices[i] > high[axis]) high[axis] = vertices[i];
    }
    chunks.push({ first, patches: count, low, high });
  }
  return chunks;
}

// Returns the half-spaces a · x + d >= 0 that contain what a picture shows. `clip`: of places relative to a point.
export function visibleHalfSpaces({ elements: e }: THREE.Matrix4, isParallel: boolean): THREE.Vector4[] {
  const row = (i: number) => new THREE.Vector4(e[i], e[4 + i], e[8 + i], e[12 + i]);
  const w = row(3);
  const sides = [row(0), row(1)].flatMap((side) => [w.clone().add(side), w.clone().sub(side)]);
  return isParallel ? sides : [w, ...sides];
}

// Returns the runs of chunks that may be visible. `origin`: that of the part, relative to the same point as
// `halfSpaces` and `within`, the box outside of which nothing is drawn.
export function selectRuns(
  chunks: readonly PatchChunk[], { step }: Pick<MeshPart, 'step'>, origin: THREE.Vector3, halfSpaces: readonly THREE.Vector4[], within: Box,
): PatchRun[] {
  const runs: PatchRun[] = [];
  const start = origin.toArray();
  for (const { first, patches, low, high } of chunks) {
    const at = (numbers: Vec3, axis: number) => start[axis] + step * numbers[axis];
    const isOutside = [0, 1, 2].some((axis) => at(high, axis) < within.low[axis] || at(low, axis) > within.high[axis]) ||
      halfSpaces.some(({ x, y, z, w }) =>
        x * at(x > 0 ? high : low, 0) + y * at(y > 0 ? high : low, 1) + z * at(z > 0 ? high : low, 2) + w < 0);
    if (isOutside) continue;
    const last = runs.at(-1);
    if (last && last.first + last.patches === first) last.patches += patches;
    else runs.push({ first, patches });
  }
  return runs;
}
