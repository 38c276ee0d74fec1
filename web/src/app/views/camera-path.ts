// A camera path along views, in the format of nerfstudio's viewer (camera_path.json), which `tessera render SCENE OUT
// --path FILE` renders. Its poses are in the world of the photos' source, z up; cameras look along -z.
import * as THREE from 'three';
import { kZUpFromYUp } from '../../axes';
import type { Tileset } from '../../tiles/tileset';
import type { View } from './view-address';

export interface PathOptions {
  width: number;
  height: number;
  fps: number;
  secondsBetween: number; // between two views
}

export const kPathOptions: PathOptions = { width: 1920, height: 1080, fps: 30, secondsBetween: 3 };

// A smooth path through all views, which does not slow down at its ends.
export function viewsAlong(views: View[], { fps, secondsBetween }: PathOptions): View[] {
  if (views.length < 2) return [...views];
  const frames = Math.round((views.length - 1) * secondsBetween * fps) + 1;
  const eyes = new THREE.CatmullRomCurve3(views.map(({ eye }) => eye), false, 'centripetal');
  const targets = new THREE.CatmullRomCurve3(views.map(({ target }) => target), false, 'centripetal');
  return Array.from({ length: frames }, (_, i) => {
    const t = i / (frames - 1);
    const place = t * (views.length - 1);
    const first = Math.min(Math.floor(place), views.length - 2);
    const fov = THREE.MathUtils.lerp(views[first].fov, views[first + 1].fov, place - first);
    return { eye: eyes.getPoint(t), target: targets.getPoint(t), fov };
  });
}

// Column-major matrix from the camera to the source's world; `fromCapture` is the tileset's sourceFromWorld.
function sourceFromCamera({ eye, target }: View, fromCapture: THREE.Matrix4): THREE.Matrix4 {
  const matrix = new THREE.Matrix4().lookAt(eye, target, new THREE.Vector3(0, 1, 0)).setPosition(eye);
  matrix.premultiply(kZUpFromYUp).premultiply(fromCapture);
  const [at, turn, scale] = [new THREE.Vector3(), new THREE.Quaternion(), new THREE.Vector3()];
  matrix.decompose(at, turn, scale);
  return matrix.compose(at, turn, new THREE.Vector3(1, 1, 1)); // poses have no scale
}

export function cameraPath(views: View[], { sourceFromWorld }: Pick<Tileset, 'sourceFromWorld'>, options = kPathOptions): string {
  const fromCapture = new THREE.Matrix4().fromArray([...sourceFromWorld]);
  const { width, height, fps, secondsBetween } = options;
  const camera_path = viewsAlong(views, options).map((view) => ({
    camera_to_world: sourceFromCamera(view, fromCapture).transpose().toArray(),
    fov: view.fov,
    aspect: width / height,
  }));
  return JSON.stringify({
    camera_type: 'perspective', render_width: width, render_height: height, fps,
    seconds: Math.max(1, views.length - 1) * secondsBetween, camera_path,
  });
}
