import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { drawAsTheyStand, makePictures } from './picture';

// Mocks a renderer of the given size, with the eyes that a headset presents to, if any.
function testRenderer(width: number, height: number, eyes?: THREE.PerspectiveCamera[]): THREE.WebGLRenderer {
  const isOn = eyes !== undefined;
  const xr = {
    enabled: isOn, isPresenting: isOn, cameraAutoUpdate: true, getCamera: () => ({ cameras: eyes }),
    updateCamera: (camera: THREE.Camera) => eyes!.forEach((eye) => eye.matrixWorld.copy(camera.parent!.matrixWorld)),
  };
  return { xr, getDrawingBufferSize: (size: THREE.Vector2) => size.set(width, height) } as unknown as THREE.WebGLRenderer;
}

function testEye(x: number, y: number, width: number, height: number): THREE.PerspectiveCamera {
  return Object.assign(new THREE.PerspectiveCamera(90, width / height, 0.1, 100), { viewport: new THREE.Vector4(x, y, width, height) });
}

const asItIs = new THREE.Matrix4();
const pictureParts = (camera: THREE.Camera, renderer: THREE.WebGLRenderer, scale: number) => {
  const { size, pictures } = makePictures(camera, renderer, asItIs, scale);
  return { size: size.toArray(), parts: pictures.map(({ part }) => part.toArray()) };
};

describe('pictures', () => {
  it('are as large as the canvas for one camera, whatever its viewport', () => {
    expect(pictureParts(testEye(3, 4, 5, 6), testRenderer(101, 51), 1)).toEqual({ size: [101, 51], parts: [[0, 0, 101, 51]] });
    expect(pictureParts(new THREE.Camera(), testRenderer(101, 51), 0.5)).toEqual({ size: [51, 26], parts: [[0, 0, 51, 26]] });
    expect(pictureParts(new THREE.Camera(), testRenderer(1, 1), 0.25)).toEqual({ size: [1, 1], parts: [[0, 0, 1, 1]] });
  });

  it('tile the target for several cameras, without gaps or overlaps, at any scale', () => {
    const camera = new THREE.ArrayCamera([testEye(0, 0, 33, 50), testEye(33, 0, 34, 50)]);
    for (const scale of [1, 0.75, 0.5, 0.375, 0.25]) {
      const { size, parts: [left, right] } = pictureParts(camera, testRenderer(200, 80), scale);
      expect(right[0]).toBe(left[0] + left[2]);
      expect(size).toEqual([right[0] + right[2], Math.round(50 * scale)]);
      expect(right[0] + right[2]).toBe(Math.round(67 * scale));
    }
  });

  it('of a headset have its current pose, and omit empty viewports', () => {
    const eyes = [testEye(0, 0, 40, 40), testEye(40, 0, 0, 40)];
    const rig = new THREE.Group();
    const camera = new THREE.PerspectiveCamera();
    rig.add(camera);
    rig.position.set(1, 2, 3);
    rig.updateMatrixWorld();
    const { pictures } = makePictures(camera, testRenderer(99, 99, eyes), asItIs, 1);
    expect(pictures).toHaveLength(1);
    expect(pictures[0].eye).toEqual([1, 2, 3]);
    expect(makePictures(camera, testRenderer(99, 99, []), asItIs, 1).pictures).toEqual([]);
  });

  it('have rays from the eye, or parallel rays from the image plane', () => {
    const pinhole = new THREE.PerspectiveCamera(90, 2, 0.5, 10);
    const parallel = new THREE.OrthographicCamera(-2, 2, 1, -1, 0.5, 10);
    for (const camera of [pinhole, parallel]) {
      camera.position.set(0, 0, 7);
      camera.updateMatrixWorld();
      const { origin, ray, eye } = makePictures(camera, testRenderer(20, 10), asItIs, 1).pictures[0];
      const at = new THREE.Vector3(1, 0.5, 1);
      const place = at.clone().applyMatrix3(origin);
      place.addScaledVector(at.applyMatrix3(ray).normalize(), 3);
      const seen = place.clone().project(camera);
      expect(seen.x).toBeCloseTo(1, 6);
      expect(seen.y).toBeCloseTo(0.5, 6);
      expect(eye[2]).toBe(camera === pinhole ? 7 : 7 + 1e7);
    }
  });

  it('are drawn with fixed cameras, which are unchanged afterwards', () => {
    const renderer = testRenderer(10, 10, []);
    const camera = new THREE.Camera();
    expect(() => drawAsTheyStand(renderer, [{ camera }], () => {
      expect([renderer.xr.enabled, camera.matrixWorldAutoUpdate]).toEqual([false, false]);
      throw new Error('no picture');
    })).toThrow('no picture');
    expect([renderer.xr.enabled, camera.matrixWorldAutoUpdate]).toEqual([true, true]);
  });
});
