import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { randomNumbers } from '../../testing/test-tree';
import type { Box } from '../../tiles/tileset';
import { joinRuns, makeChunks, screenRectangle, selectChunks, visibleHalfSpaces } from './patch-chunks';

const kEverywhere: Box = { low: [-1e9, -1e9, -1e9], high: [1e9, 1e9, 1e9] };
const part = { step: 0.01 };

// Patches along the x axis from 0 to 100, each with the size of a few numbers.
function patchesInARow(count: number): Uint16Array {
  const vertices = new Uint16Array(12 * count);
  for (let i = 0; i < vertices.length; ++i) {
    const patch = Math.floor(i / 12);
    vertices[i] = i % 3 === 0 ? Math.floor((patch / count) * 10000) + (Math.floor(i / 3) % 2) : 50 + (Math.floor(i / 6) % 2);
  }
  return vertices;
}

function camera(eye: THREE.Vector3, target: THREE.Vector3): THREE.Matrix4 {
  const one = new THREE.PerspectiveCamera(40, 1.5, 0.1, 1000);
  one.position.copy(eye);
  one.lookAt(target);
  one.updateMatrixWorld();
  return one.projectionMatrix.clone().multiply(one.matrixWorldInverse);
}

describe('chunks of patches', () => {
  it('hold all patches once, in boxes around their vertices', () => {
    const vertices = patchesInARow(1000);
    const chunks = makeChunks(vertices);
    expect(chunks.map(({ first, patches }) => [first, patches])).toEqual([[0, 256], [256, 256], [512, 256], [768, 232]]);
    for (const { first, patches, low, high } of chunks) {
      for (let i = 12 * first; i < 12 * (first + patches); ++i) {
        expect(vertices[i]).toBeGreaterThanOrEqual(low[i % 3]);
        expect(vertices[i]).toBeLessThanOrEqual(high[i % 3]);
      }
    }
    expect(makeChunks(new Uint16Array())).toEqual([]);
  });

  it('are selected if a picture may show them, and join to runs', () => {
    const chunks = makeChunks(patchesInARow(1024));
    const ahead = camera(new THREE.Vector3(60, 0.5, 0.5), new THREE.Vector3(100, 0.5, 0.5));
    const selected = selectChunks(chunks, part, new THREE.Vector3(), visibleHalfSpaces(ahead, false), kEverywhere);
    expect(joinRuns(selected)).toEqual([{ first: 512, patches: 512 }]);
    expect(joinRuns([chunks[0], chunks[2], chunks[3]])).toEqual([{ first: 0, patches: 256 }, { first: 512, patches: 512 }]);
    const moved = new THREE.Vector3(-60, 0, 0);
    expect(selectChunks(chunks, part, moved, visibleHalfSpaces(ahead, false), kEverywhere)).toEqual([]);
    const away = camera(new THREE.Vector3(0, 50, 0.5), new THREE.Vector3(0, 100, 0.5));
    expect(selectChunks(chunks, part, new THREE.Vector3(), visibleHalfSpaces(away, false), kEverywhere)).toEqual([]);
  });

  it('are not selected outside of the box', () => {
    const chunks = makeChunks(patchesInARow(1024));
    const within: Box = { low: [30, -1e9, -1e9], high: [40, 1e9, 1e9] };
    expect(joinRuns(selectChunks(chunks, part, new THREE.Vector3(), [], within))).toEqual([{ first: 256, patches: 256 }]);
  });

  it('are never left out, nor out of their rectangle, if a vertex of theirs is visible', () => {
    const random = randomNumbers(7);
    const vertices = new Uint16Array(12 * 2048);
    for (let patch = 0; patch < 2048; ++patch) {
      const middle = [0, 1, 2].map((axis) => (Math.floor(patch / 256) >> axis) % 2 * 8000 + random() * 2000);
      for (let i = 0; i < 12; ++i) vertices[12 * patch + i] = middle[i % 3] + random() * 100;
    }
    const chunks = makeChunks(vertices);
    let [leftOut, smaller] = [0, 0];
    for (let round = 0; round < 50; ++round) {
      const place = () => new THREE.Vector3(100 * random(), 100 * random(), 100 * random());
      const clip = camera(place(), place());
      const selected = selectChunks(chunks, part, new THREE.Vector3(), visibleHalfSpaces(clip, false), kEverywhere);
      const runs = joinRuns(selected);
      const isSelected = (patch: number) => runs.some(({ first, patches }) => patch >= first && patch < first + patches);
      const [left, bottom, right, top] = screenRectangle(selected, part, new THREE.Vector3(), clip) ?? [1, 1, -1, -1];
      if (right - left < 2 || top - bottom < 2) ++smaller;
      leftOut += chunks.filter(({ first }) => !isSelected(first)).length;
      for (let corner = 0; corner < 4 * 2048; corner += 5) {
        const [x, y, z] = vertices.subarray(3 * corner, 3 * corner + 3);
        const at = new THREE.Vector4(part.step * x, part.step * y, part.step * z, 1).applyMatrix4(clip);
        if (!(at.w > 0 && at.z >= -at.w && Math.abs(at.x) <= at.w && Math.abs(at.y) <= at.w)) continue;
        expect(isSelected(corner >> 2)).toBe(true);
        expect(at.x / at.w >= left && at.x / at.w <= right && at.y / at.w >= bottom && at.y / at.w <= top).toBe(true);
      }
    }
    expect(leftOut).toBeGreaterThan(100);
    expect(smaller).toBeGreaterThan(10);
  });
});
