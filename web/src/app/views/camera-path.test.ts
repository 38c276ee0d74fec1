import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { cameraPath, kPathOptions, viewsAlong } from './camera-path';

const look = (x: number) => ({ eye: new THREE.Vector3(x, 10, 0), target: new THREE.Vector3(x, 0, -10), fov: 50 + x });
const turned = [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1]; // a quarter turn about z with a scale of 2 and a translation

describe('a camera path', () => {
  it('begins and ends at the first and last view, and passes through those between', () => {
    const path = viewsAlong([look(0), look(10), look(30)], { ...kPathOptions, fps: 10, secondsBetween: 2 });
    expect(path).toHaveLength(41);
    for (const [frame, x] of [[0, 0], [20, 10], [40, 30]]) {
      expect(path[frame].eye.distanceTo(look(x).eye)).toBeLessThan(1e-9);
      expect(path[frame].fov).toBeCloseTo(50 + x);
    }
    for (let i = 1; i < path.length; ++i) expect(path[i].eye.x).toBeGreaterThan(path[i - 1].eye.x);
  });

  it('is in the world of the source, row-major, and without scale', () => {
    const { camera_path } = JSON.parse(cameraPath([look(3)], { sourceFromWorld: turned })) as { camera_path: { camera_to_world: number[] }[] };
    const m = camera_path[0].camera_to_world;
    // In the capture's world the camera is at (3, 0, 10) and looks to (3, 10, 0). In the source's world these are
    // 2 (-y, x) + (5, 6) and 2 z + 7.
    const expected = [5, 12, 27];
    [3, 7, 11].forEach((at, i) => expect(m[at]).toBeCloseTo(expected[i]));
    const back = [m[2], m[6], m[10]];
    [Math.SQRT1_2, 0, Math.SQRT1_2].forEach((x, i) => expect(back[i]).toBeCloseTo(x));
    expect(m.slice(12)).toEqual([0, 0, 0, 1]);
  });

  it('of one view has one frame', () => {
    expect(viewsAlong([look(1)], kPathOptions)).toHaveLength(1);
  });
});
