// The triangles of a part as geometry of three.js. A patch has four corners, and gl_VertexID is 4 · patch + corner.
import * as THREE from 'three';
import { kCornerNumbers, type MeshPart } from './mesh-content';
import type { PatchRun } from './patch-chunks';

const kCorners = [0, 1, 2, 3, 2, 1]; // of two triangles
const kLargestOfTwoBytes = 0xfffe; // 0xffff restarts primitives

function indexArray(patches: number): Uint16ArrayConstructor | Uint32ArrayConstructor {
  return 4 * patches - 1 <= kLargestOfTwoBytes ? Uint16Array : Uint32Array;
}

// Returns the size of the indices, in bytes.
export function bytesOfIndices({ patches }: Pick<MeshPart, 'patches'>): number {
  return kCorners.length * patches * indexArray(patches).BYTES_PER_ELEMENT;
}

// `vertices` are MeshTexels.vertices; the geometry takes them over.
export function patchGeometry({ patches, pairs }: Pick<MeshPart, 'patches' | 'pairs'>, vertices: Uint16Array): THREE.BufferGeometry {
  const indices = new (indexArray(patches))(kCorners.length * patches);
  for (let patch = 0, at = 0; patch < patches; ++patch) {
    for (const corner of kCorners) indices[at++] = 4 * patch + corner;
  }
  for (let patch = pairs; patch < patches; ++patch) {
    // The second triangle of a patch with one has no area: its corner 3 is where corner 1 is.
    const first = kCornerNumbers * patch;
    vertices.copyWithin(first + 9, first + 3, first + 6);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', untilUploaded(new THREE.BufferAttribute(vertices, 3)));
  geometry.setIndex(untilUploaded(new THREE.BufferAttribute(indices, 1)));
  geometry.boundingSphere = new THREE.Sphere(); // three.js sorts what it draws by it; the order is that of renderOrder
  return geometry;
}

// Limits what is drawn to a run of patches.
export function drawRange(geometry: THREE.BufferGeometry, { first, patches }: PatchRun): void {
  geometry.setDrawRange(kCorners.length * first, kCorners.length * patches);
}

// Keeps the numbers in the page only until they are on the GPU.
function untilUploaded(attribute: THREE.BufferAttribute): THREE.BufferAttribute {
  return attribute.onUpload(function release(this: THREE.BufferAttribute) {
    (this as { array: unknown }).array = null;
  });
}
