// Pictures: the viewports of a render target with their cameras. There is one for an ordinary camera, and several side
// by side for an ArrayCamera or the eyes of a headset.
import * as THREE from 'three';
import type { Vec3 } from '../tiles/tileset';

// Lengths are in scene units; `ndc` runs from -1 to 1 across the picture.
export interface Picture {
  camera: THREE.Camera;
  part: THREE.Vector4; // viewport in the target, in pixels: left, bottom, width, height
  eye: Vec3; // for a parallel projection, a point far behind the image plane from which its rays diverge very little
  origin: THREE.Matrix3; // maps (ndc.x, ndc.y, 1) to the origin of the ray
  ray: THREE.Matrix3; // maps the same to the direction of the ray, which is not normalised
  sceneFromClip: THREE.Matrix4;
  clipFromScene: THREE.Matrix4;
}

// Returns the pictures that three.js will draw for this camera; none while a headset has no pose. `scale` is the
// resolution of the target relative to that of the canvas, along an edge.
export function makePictures(
  camera: THREE.Camera, renderer: THREE.WebGLRenderer, worldFromScene: THREE.Matrix4, scale: number,
): { size: THREE.Vector2; pictures: Picture[] } {
  const size = new THREE.Vector2();
  const pictures = listViewports(camera, renderer).map(({ camera: one, viewport: { x, y, z, w } }) => {
    const part = new THREE.Vector4(Math.round(scale * x), Math.round(scale * y));
    part.z = Math.max(1, Math.round(scale * (x + z)) - part.x);
    part.w = Math.max(1, Math.round(scale * (y + w)) - part.y);
    size.max(new THREE.Vector2(part.x + part.z, part.y + part.w));
    return makePicture(one, part, worldFromScene);
  });
  return { size, pictures };
}

// Renders with the cameras' matrices as they are: three.js neither updates them nor substitutes a headset's cameras.
export function drawAsTheyStand(renderer: THREE.WebGLRenderer, pictures: Pick<Picture, 'camera'>[], draw: () => void): void {
  const { enabled } = renderer.xr;
  const wereUpdated = pictures.map(({ camera }) => camera.matrixWorldAutoUpdate);
  renderer.xr.enabled = false;
  for (const { camera } of pictures) camera.matrixWorldAutoUpdate = false;
  try {
    draw();
  } finally {
    renderer.xr.enabled = enabled;
    pictures.forEach(({ camera }, i) => (camera.matrixWorldAutoUpdate = wereUpdated[i]));
  }
}

// Returns the cameras with their viewports, in pixels of what three.js renders into.
function listViewports(camera: THREE.Camera, renderer: THREE.WebGLRenderer): { camera: THREE.Camera; viewport: THREE.Vector4 }[] {
  const { x, y } = renderer.getDrawingBufferSize(new THREE.Vector2());
  const whole = new THREE.Vector4(0, 0, x, y);
  const several = subCameras(camera, renderer);
  if (!several) return [{ camera, viewport: whole }];
  return several
    .map((one) => ({ camera: one as THREE.Camera, viewport: one.viewport ?? whole }))
    .filter(({ viewport }) => viewport.z > 0 && viewport.w > 0);
}

function subCameras(camera: THREE.Camera, { xr }: THREE.WebGLRenderer): readonly (THREE.Camera & { viewport?: THREE.Vector4 })[] | undefined {
  if (xr.enabled && xr.isPresenting) {
    // Updates the camera to the current head pose, which three.js only does when it renders.
    if (xr.cameraAutoUpdate) xr.updateCamera(camera as THREE.PerspectiveCamera);
    return xr.getCamera().cameras;
  }
  return camera instanceof THREE.ArrayCamera ? camera.cameras : undefined;
}

function makePicture(camera: THREE.Camera, part: THREE.Vector4, worldFromScene: THREE.Matrix4): Picture {
  const sceneFromCamera = worldFromScene.clone().invert().multiply(camera.matrixWorld);
  const sceneFromClip = sceneFromCamera.clone().multiply(camera.projectionMatrixInverse);
  const clipFromScene = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).multiply(worldFromScene);
  // Points of the near plane, which are linear in ndc for perspective and parallel projections.
  const at = (x: number, y: number) => new THREE.Vector3(x, y, -1).applyMatrix4(sceneFromClip);
  const [middle, right, up] = [at(0, 0), at(1, 0), at(0, 1)];
  const across = right.sub(middle);
  const along = up.sub(middle);
  const eye = new THREE.Vector3().setFromMatrixPosition(sceneFromCamera);
  const back = new THREE.Vector3().setFromMatrixColumn(sceneFromCamera, 2).normalize();
  const zero = new THREE.Vector3();
  const columns = (a: THREE.Vector3, b: THREE.Vector3, c: THREE.Vector3) => new THREE.Matrix3().set(a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z);
  const common = { camera, part, sceneFromClip, clipFromScene };
  return isParallel(camera)
    ? {
      ...common, eye: asVec3(eye.addScaledVector(back, 1e7)),
      origin: columns(across, along, middle), ray: columns(zero, zero, back.negate()),
    }
    : { ...common, eye: asVec3(eye), origin: columns(zero, zero, eye), ray: columns(across, along, middle.sub(eye)) };
}

export function isParallel(camera: THREE.Camera): boolean {
  return camera.projectionMatrix.elements[15] === 1;
}

function asVec3({ x, y, z }: THREE.Vector3): Vec3 {
  return [x, y, z];
}
