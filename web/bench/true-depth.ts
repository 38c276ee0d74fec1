// Ground-truth depth of the photos of a synthetic capture.
import { readFileSync } from 'node:fs';
import * as THREE from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import type { View } from '../src/headless-page';

export interface SeenPlace {
  place: number[]; // in the capture's world
  eye: number[];
  pixel: [number, number]; // of the view, from the upper left corner
}

const kStride = 24; // pixels of the photo between sampled places
const kFlat = 0.02; // relative depth difference allowed between neighbours, as edges of objects may be off by a pixel

// Returns places that a photo shows in the middles of pixels of a pinhole camera at the photo's pose. `lens` has OpenCV's parameters:
// fx fy cx cy k1 k2 p1 p2. Depth is along the camera's axis, in world units.
export function placesOfDepth(file: string, lens: number[], view: View): SeenPlace[] {
  const bytes = readFileSync(file);
  // The loader does not support a channel for depth, so it is renamed to one for luminance.
  const name = bytes.indexOf('channels\0chlist\0') + 20;
  if (bytes.toString('latin1', name, name + 2) !== 'Z\0') throw new Error(`${file} is no depth map`);
  bytes.write('Y', name);
  const loader = new EXRLoader();
  loader.setDataType(THREE.FloatType);
  const { data, width, height } = loader.parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length) as ArrayBuffer) as {
    data: Float32Array; width: number; height: number;
  };
  const channels = data.length / (width * height);
  const depthAt = (x: number, y: number) => data[channels * (x + width * (height - 1 - y))]; // rows from below
  const matrix = new THREE.Matrix4().fromArray(view.matrix);
  const eye = new THREE.Vector3().setFromMatrixPosition(matrix);
  const places: SeenPlace[] = [];
  for (let y = kStride; y < height - kStride; y += kStride) {
    for (let x = kStride; x < width - kStride; x += kStride) {
      const middle = depthAt(x, y);
      const around = [[-2, 0], [2, 0], [0, -2], [0, 2]].map(([dx, dy]) => depthAt(x + dx, y + dy));
      if (!(middle > 0 && middle < 1e4) || around.some((other) => !(Math.abs(other - middle) < kFlat * middle))) continue;
      const [nearU, nearV] = undistorted(x + 0.5, y + 0.5, lens);
      const pixel: [number, number] = [Math.floor(view.cx + view.fx * nearU), Math.floor(view.cy + view.fy * nearV)];
      if (pixel[0] < 0 || pixel[1] < 0 || pixel[0] >= view.width || pixel[1] >= view.height) continue;
      // The place that the middle of that pixel shows, less than two pixels of the photo away.
      const [u, v] = [(pixel[0] + 0.5 - view.cx) / view.fx, (pixel[1] + 0.5 - view.cy) / view.fy];
      const [left, above] = distorted(u, v, lens).map((at) => at - 0.5);
      const [i, j] = [Math.floor(left), Math.floor(above)];
      if (Math.abs(i - x) > 2 || Math.abs(j - y) > 2) continue;
      const [right, below] = [left - i, above - j];
      // On a plane, the inverse of the depth is linear.
      const depth = 1 / (
        (1 - below) * ((1 - right) / depthAt(i, j) + right / depthAt(i + 1, j)) +
        below * ((1 - right) / depthAt(i, j + 1) + right / depthAt(i + 1, j + 1)));
      const place = new THREE.Vector3(u * depth, -v * depth, -depth).applyMatrix4(matrix);
      places.push({ place: place.toArray(), eye: eye.toArray(), pixel });
    }
  }
  return places;
}

// Returns the place in the photo, in pixels, where the plane at depth 1 is seen.
function distorted(u: number, v: number, [fx, fy, cx, cy, k1, k2, p1, p2]: number[]): [number, number] {
  const r = u * u + v * v;
  const radial = 1 + k1 * r + k2 * r * r;
  const [du, dv] = [2 * p1 * u * v + p2 * (r + 2 * u * u), p1 * (r + 2 * v * v) + 2 * p2 * u * v];
  return [fx * (u * radial + du) + cx, fy * (v * radial + dv) + cy];
}

// Returns where the ray of a pixel meets the plane at depth 1, y downwards; iterates, as the distortion is small.
function undistorted(x: number, y: number, [fx, fy, cx, cy, k1, k2, p1, p2]: number[]): [number, number] {
  const [a, b] = [(x - cx) / fx, (y - cy) / fy];
  let [u, v] = [a, b];
  for (let i = 0; i < 20; ++i) {
    const r = u * u + v * v;
    const radial = 1 + k1 * r + k2 * r * r;
    const [du, dv] = [2 * p1 * u * v + p2 * (r + 2 * u * u), p1 * (r + 2 * v * v) + 2 * p2 * u * v];
    [u, v] = [(a - du) / radial, (b - dv) / radial];
  }
  return [u, v];
}
