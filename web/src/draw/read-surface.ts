// Reads one pixel of a scene's image.
import * as THREE from 'three';
import type { Picture } from './picture';

// Returns the pixel of an image that shows a point of a picture; `at` runs from -1 to 1 across it, y upwards.
export function pixelAt({ part }: Pick<Picture, 'part'>, at: THREE.Vector2): [number, number] {
  const pixel = (x: number, size: number) => Math.min(Math.max(Math.floor((0.5 + 0.5 * x) * size), 0), size - 1);
  return [part.x + pixel(at.x, part.z), part.y + pixel(at.y, part.w)];
}

// Returns the place at a distance along the ray through a point of a picture, in scene units.
export function placeAtDistance({ origin, ray }: Pick<Picture, 'origin' | 'ray'>, at: THREE.Vector2, distance: number): THREE.Vector3 {
  const inPicture = new THREE.Vector3(at.x, at.y, 1);
  const direction = inPicture.clone().applyMatrix3(ray).normalize();
  return inPicture.applyMatrix3(origin).addScaledVector(direction, distance);
}

// `target` has distances with alpha in its second attachment, as DrawnPicture describes. Returns the surface at a point
// of a picture, in scene units; `at` runs from -1 to 1 across it, y upwards.
export function readSurface(
  renderer: THREE.WebGLRenderer, { target, distancesOfBytes }: { target: THREE.WebGLRenderTarget; distancesOfBytes: boolean },
  picture: Picture, at: THREE.Vector2,
): THREE.Vector3 | undefined {
  const { type } = target.textures[1];
  const read = type === THREE.FloatType ? new Float32Array(4) : type === THREE.HalfFloatType ? new Uint16Array(4) : new Uint8Array(4);
  renderer.readRenderTargetPixels(target, ...pixelAt(picture, at), 1, 1, read, undefined, 1);
  const [value, , , hides] = [...read].map(
    (x) => (type === THREE.FloatType ? x : type === THREE.HalfFloatType ? THREE.DataUtils.fromHalfFloat(x) : x / 255));
  if (hides <= 0.99) return undefined;
  const distance = distancesOfBytes ? value / hides / Math.max(1 - value / hides, 1e-3) : value / hides;
  return placeAtDistance(picture, at, distance);
}
