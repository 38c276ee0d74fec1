// Cameras of tests: pinhole cameras at places of a scene.
import type { View } from '../src/headless-page';
import type { Tileset } from '../src/tiles/tileset';

export type Place = readonly [number, number, number]; // scene units

export const kWidth = 480;
export const kHeight = 270;
export const kFieldOfView = 60; // vertical, in degrees

// Column-major matrix from the camera (x right, y up, z back) to the capture's world.
export function worldFromCamera(tileset: Tileset, eye: Place, target: Place): number[] {
  const minus = (a: Place, b: Place): Place => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a: Place, b: Place): Place => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a: Place): Place => [a[0] / Math.hypot(...a), a[1] / Math.hypot(...a), a[2] / Math.hypot(...a)];
  const back = unit(minus(eye, target));
  const right = unit(cross([0, 0, 1], back));
  const { rotation: r, scale, translation } = tileset.worldFromScene;
  const turned = (a: Place) => [0, 1, 2].map((row) => r[row] * a[0] + r[3 + row] * a[1] + r[6 + row] * a[2]);
  const place = turned(eye).map((x, row) => scale * x + translation[row]);
  return [...turned(right), 0, ...turned(cross(back, right)), 0, ...turned(back), 0, ...place, 1];
}

export function viewAt(tileset: Tileset, eye: Place, target: Place): View {
  const focal = kHeight / 2 / Math.tan((kFieldOfView * Math.PI) / 360);
  const matrix = worldFromCamera(tileset, eye, target);
  return { matrix, fx: focal, fy: focal, cx: kWidth / 2, cy: kHeight / 2, width: kWidth, height: kHeight };
}
