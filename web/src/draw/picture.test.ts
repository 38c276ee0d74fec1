import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { drawAsTheyStand, picturesOf } from './picture';

// Of so many pixels; with the eyes that a headset presents to, if any.
function madeRenderer(width: number, height: number, eyes?: THREE.PerspectiveCamera[]): THREE.WebGLRenderer {
  const isOn = eyes !== undefined;
  const xr = {
    enabled: isOn, isPresenting: isOn, cameraAutoUpdate: true, getCamera: () => ({ cameras: eyes }),
    updateCamera: (camera: THREE.Camera) => eyes!.forEach((eye) => eye.matrixWorld.copy(camera.parent!.matrixWorld)),
  };
  return { xr, getDrawingBufferSize: (size: THREE.Vector2) => size.set(width, height) } as unknown as THREE.WebGLRenderer;
}

function madeEye(x: number, y: number, width: number, height: number): THREE.PerspectiveCamera {
  return Object.assign(new THREE.PerspectiveCamera(90, width / height, 0.1, 100), { viewport: new THREE.Vector4(x, y, width, height) });
}

const asItIs = new THREE.Matrix4();
const partsOf = (camera: THREE.Camera, renderer: THREE.WebGLRenderer, scale: number) => {
  const { size, pictures } = picturesOf(camera, renderer, asItIs, scale);
  return { size: size.toArray(), parts: pictures.map(({ part }) => part.toArray()) };
};

describe('pictures', () => {
  it('are as large as the canvas for one camera, whatever viewport it would have among others', () => {
    expect(partsOf(madeEye(3, 4, 5, 6), madeRenderer(101, 51), 1)).toEqual({ size: [101, 51], parts: [[0, 0, 101, 51]] });
    expect(partsOf(new THREE.Camera(), madeRenderer(101, 51), 0.5)).toEqual({ size: [51, 26], parts: [[0, 0, 51, 26]] });
    expect(partsOf(new THREE.Camera(), madeRenderer(1, 1), 0.25)).toEqual({ size: [1, 1], parts: [[0, 0, 1, 1]] });
  });

  it('lie beside one another for several cameras, without gaps and none over another, at any scale', () => {
    const camera = new THREE.ArrayCamera([madeEye(0, 0, 33, 50), madeEye(33, 0, 34, 50)]);
    for (const scale of [1, 0.75, 0.5, 0.375, 0.25]) {
      const { size, parts: [left, right] } = partsOf(camera, madeRenderer(200, 80), scale);
      expect(right[0]).toBe(left[0] + left[2]);
      expect(size).toEqual([right[0] + right[2], Math.round(50 * scale)]);
      expect(right[0] + right[2]).toBe(Math.round(67 * scale));
    }
  });

  it('of a headset are of where the head is now, and none of what it does not show', () => {
    const eyes = [madeEye(0, 0, 40, 40), madeEye(40, 0, 0, 40)];
    const rig = new THREE.Group();
    const camera = new THREE.PerspectiveCamera();
    rig.add(camera);
    rig.position.set(1, 2, 3);
    rig.updateMatrixWorld();
    const { pictures } = picturesOf(camera, madeRenderer(99, 99, eyes), asItIs, 1);
    expect(pictures).toHaveLength(1);
    expect(pictures[0].eye).toEqual([1, 2, 3]);
    expect(picturesOf(camera, madeRenderer(99, 99, []), asItIs, 1).pictures).toEqual([]);
  });

  it('have rays from the eye, or side by side from the picture of a parallel projection', () => {
    const pinhole = new THREE.PerspectiveCamera(90, 2, 0.5, 10);
    const parallel = new THREE.OrthographicCamera(-2, 2, 1, -1, 0.5, 10);
    for (const camera of [pinhole, parallel]) {
      camera.position.set(0, 0, 7);
      camera.updateMatrixWorld();
      const { origin, ray, eye } = picturesOf(camera, madeRenderer(20, 10), asItIs, 1).pictures[0];
      const at = new THREE.Vector3(1, 0.5, 1);
      const place = at.clone().applyMatrix3(origin);
      place.addScaledVector(at.applyMatrix3(ray).normalize(), 3);
      const seen = place.clone().project(camera);
      expect(seen.x).toBeCloseTo(1, 6);
      expect(seen.y).toBeCloseTo(0.5, 6);
      expect(eye[2]).toBe(camera === pinhole ? 7 : 7 + 1e7);
    }
  });

  it('are drawn with cameras that nobody moves meanwhile, and that are as they were afterwards', () => {
    const renderer = madeRenderer(10, 10, []);
    const camera = new THREE.Camera();
    expect(() => drawAsTheyStand(renderer, [{ camera }], () => {
      expect([renderer.xr.enabled, camera.matrixWorldAutoUpdate]).toEqual([false, false]);
      throw new Error('no picture');
    })).toThrow('no picture');
    expect([renderer.xr.enabled, camera.matrixWorldAutoUpdate]).toEqual([true, true]);
  });
});
