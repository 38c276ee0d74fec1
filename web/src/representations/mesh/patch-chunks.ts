// Chunks of consecutive patches, so that those outside of a picture are not drawn. Patches that follow one another are
// near one another in our scenes (docs/tile-format.md, section 8), so chunks are small.
import * as THREE from 'three';
import type { Box, Vec3 } from '../../tiles/tileset';
import { kCornerNumbers, type MeshPart } from './mesh-content';

const kPatchesOfChunk = 256;
const kSmallestDepth = 1e-6; // scene units

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

// A rectangle of a picture: two opposite corners, from -1 to 1.
export type ScreenRectangle = readonly [number, number, number, number];

// Returns the chunks that may be visible. `origin`: that of the part, relative to the same point as `halfSpaces` and
// `within`, the box outside of which nothing is drawn.
export function selectChunks(
  chunks: readonly PatchChunk[], { step }: Pick<MeshPart, 'step'>, origin: THREE.Vector3, halfSpaces: readonly THREE.Vector4[], within: Box,
): PatchChunk[] {
  const start = origin.toArray();
  return chunks.filter(({ low, high }) => {
    const at = (numbers: Vec3, axis: number) => start[axis] + step * numbers[axis];
    const isOutside = [0, 1, 2].some((axis) => at(high, axis) < within.low[axis] || at(low, axis) > within.high[axis]) ||
      halfSpaces.some(({ x, y, z, w }) =>
        x * at(x > 0 ? high : low, 0) + y * at(y > 0 ? high : low, 1) + z * at(z > 0 ? high : low, 2) + w < 0);
    return !isOutside;
  });
}

// Returns the runs of successive chunks.
export function joinRuns(chunks: readonly PatchChunk[]): PatchRun[] {
  const runs: PatchRun[] = [];
  for (const { first, patches } of chunks) {
    const last = runs.at(-1);
    if (last && last.first + last.patches === first) last.patches += patches;
    else runs.push({ first, patches });
  }
  return runs;
}

// Returns a rectangle that contains what chunks show in a picture, or nothing if they show nothing. `clip`: of places
// relative to the same point as `origin`; what is nearer than its near plane is not shown.
export function screenRectangle(
  chunks: readonly PatchChunk[], { step }: Pick<MeshPart, 'step'>, origin: THREE.Vector3, { elements: e }: THREE.Matrix4,
): ScreenRectangle | undefined {
  const [x, y, z] = origin.toArray();
  const corners = new Float64Array(4 * 8); // x, y, w, and the distance from the near plane
  const bounds: [number, number, number, number] = [1, 1, -1, -1];
  const add = (along: number, up: number, w: number) => {
    bounds[0] = Math.min(bounds[0], along / w);
    bounds[1] = Math.min(bounds[1], up / w);
    bounds[2] = Math.max(bounds[2], along / w);
    bounds[3] = Math.max(bounds[3], up / w);
  };
  for (const { low, high } of chunks) {
    for (let corner = 0; corner < 8; ++corner) {
      const px = x + step * (corner & 1 ? high : low)[0];
      const py = y + step * (corner & 2 ? high : low)[1];
      const pz = z + step * (corner & 4 ? high : low)[2];
      const at = 4 * corner;
      for (let row = 0; row < 2; ++row) corners[at + row] = e[row] * px + e[4 + row] * py + e[8 + row] * pz + e[12 + row];
      const w = e[3] * px + e[7] * py + e[11] * pz + e[15];
      corners[at + 2] = w;
      corners[at + 3] = e[2] * px + e[6] * py + e[10] * pz + e[14] + w;
      if (corners[at + 3] >= 0) add(corners[at], corners[at + 1], Math.max(w, kSmallestDepth));
    }
    // Where the near plane cuts an edge.
    for (let first = 0; first < 8; ++first) {
      for (let bit = 1; bit < 8; bit *= 2) {
        if (first & bit) continue;
        const [a, b] = [4 * first, 4 * (first | bit)];
        if (corners[a + 3] >= 0 === corners[b + 3] >= 0) continue;
        const t = corners[a + 3] / (corners[a + 3] - corners[b + 3]);
        const mix = (n: number) => corners[a + n] + t * (corners[b + n] - corners[a + n]);
        add(mix(0), mix(1), Math.max(mix(2), kSmallestDepth));
      }
    }
  }
  const [left, bottom, right, top] = bounds.map((bound) => Math.min(1, Math.max(-1, bound)));
  return left < right && bottom < top ? [left, bottom, right, top] : undefined;
}
