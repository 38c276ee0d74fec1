// Where a picture is drawn from, relative to a reference point: the eye, or, of a parallel projection, the middle of the
// image plane. All is computed in double precision, so that the GPU needs single precision only.
import * as THREE from 'three';
import { isParallel, type Picture } from '../../draw/picture';
import type { Box, Vec3 } from '../../tiles/tileset';

export function referencePoint({ origin: { elements } }: Pick<Picture, 'origin'>): THREE.Vector3 {
  return new THREE.Vector3(elements[6], elements[7], elements[8]);
}

// Returns the matrix for places relative to a point.
export function relativeTo(point: THREE.Vector3, matrix: THREE.Matrix4): THREE.Matrix4 {
  return matrix.clone().multiply(new THREE.Matrix4().makeTranslation(point));
}

export function matrixRow({ elements }: THREE.Matrix4, row: number): THREE.Vector4 {
  return new THREE.Vector4(elements[row], elements[4 + row], elements[8 + row], elements[12 + row]);
}

// Returns Picture.origin relative to the point.
export function relativeOrigin(point: THREE.Vector3, origin: THREE.Matrix3): THREE.Matrix3 {
  const moved = origin.clone();
  point.toArray().forEach((x, row) => (moved.elements[6 + row] -= x));
  return moved;
}

// Returns the offset of the places that pixels show in a frame, in pixels: from -½ to ½ (Halton's sequence).
export function frameJitter(frame: number): THREE.Vector2 {
  const inverse = (base: number) => {
    let [sum, digit] = [0, 1];
    for (let rest = frame + 1; rest > 0; rest = Math.floor(rest / base)) sum += (digit /= base) * (rest % base);
    return sum;
  };
  return new THREE.Vector2(inverse(2) - 0.5, inverse(3) - 0.5);
}

// Returns the projection of an image whose pixels show places that are `jitter` pixels away.
export function jittered(projection: THREE.Matrix4, jitter: THREE.Vector2, { part }: Pick<Picture, 'part'>): THREE.Matrix4 {
  const moved = projection.clone();
  const { elements } = moved;
  for (let column = 0; column < 16; column += 4) {
    elements[column] -= ((2 * jitter.x) / part.z) * elements[column + 3];
    elements[column + 1] -= ((2 * jitter.y) / part.w) * elements[column + 3];
  }
  return moved;
}

// Returns the projection for places relative to the point, with a near plane of its own (the user's might cut parts of
// the scene off) and the far plane at infinity, or, of a parallel projection, behind the boxes that are drawn. `nearest`
// is the distance of the nearest place, scene units.
export function rasterProjection(picture: Picture, clip: THREE.Matrix4, nearest: number, boxes: readonly Box[]): THREE.Matrix4 {
  const projection = clip.clone();
  if (isParallel(picture.camera)) {
    const d = new THREE.Vector3(0, 0, 1).applyMatrix3(picture.ray).normalize();
    const start = referencePoint(picture).dot(d);
    const farthest = ({ low, high }: Box) => Math.max(d.x * low[0], d.x * high[0]) + Math.max(d.y * low[1], d.y * high[1]) + Math.max(d.z * low[2], d.z * high[2]);
    const far = 2 * Math.max(1, ...boxes.map((box) => farthest(box) - start));
    const { elements } = projection;
    [elements[2], elements[6], elements[10], elements[14]] = [(2 * d.x) / far, (2 * d.y) / far, (2 * d.z) / far, -1];
    return projection;
  }
  // The fourth row is the depth along the optical axis. Corners of the image have the smallest depth at a distance.
  const w = matrixRow(clip, 3);
  const depth = Math.min(...[-1, 1].flatMap((x) => [-1, 1].map((y) => {
    const d = new THREE.Vector3(x, y, 1).applyMatrix3(picture.ray).normalize();
    return d.x * w.x + d.y * w.y + d.z * w.z;
  })));
  const near = 0.5 * nearest * depth; // half, against rounding
  const { elements } = projection;
  elements[2] = w.x;
  elements[6] = w.y;
  elements[10] = w.z;
  elements[14] = w.w - 2 * near;
  return projection;
}

// Returns the distance of a place in a box from its nearest side; 0 outside of it.
export function distanceToSides({ low, high }: Box, place: Vec3): number {
  return Math.max(0, Math.min(...place.map((a, axis) => Math.min(a - low[axis], high[axis] - a))));
}

export function distanceToBox({ low, high }: Box, [x, y, z]: Vec3): number {
  return Math.hypot(...[x, y, z].map((a, axis) => Math.max(low[axis] - a, 0, a - high[axis])));
}
