// Reads one pixel of a scene's image.
import * as THREE from 'three';
import type { Picture } from './picture';

// `target` has distances with alpha in its second attachment, as DrawnPicture describes. Returns the surface at a point
// of a picture, in scene units; `at` runs from -1 to 1 across it, y upwards.
export function readSurface(
  renderer: THREE.WebGLRenderer, { target, distancesOfBytes }: { target: THREE.WebGLRenderTarget; distancesOfBytes: boolean },
  { part, origin, ray }: Picture, at: THREE.Vector2,
): THREE.Vector3 | undefined {
  const pixel = (x: number, size: number) => Math.min(Math.max(Math.floor((0.5 + 0.5 * x) * size), 0), size - 1);
  const { type } = target.textures[1];
  const read = type === THREE.FloatType ? new Float32Array(4) : type === THREE.HalfFloatType ? new Uint16Array(4) : new Uint8Array(4);
  renderer.readRenderTargetPixels(target, part.x + pixel(at.x, part.z), part.y + pixel(at.y, part.w), 1, 1, read, undefined, 1);
  const [value, , , hides] = [...read].map(
    (x) => (type === THREE.FloatType ? x : type === THREE.HalfFloatType ? THREE.DataUtils.fromHalfFloat(x) : x / 255));
  if (hides <= 0.99) return undefined;
  const distance = distancesOfBytes ? value / hides / Math.max(1 - value / hides, 1e-3) : value / hides;
  const inPicture = new THREE.Vector3(at.x, at.y, 1);
  const direction = inPicture.clone().applyMatrix3(ray).normalize();
  return inPicture.applyMatrix3(origin).addScaledVector(direction, distance);
}
