// Updates several scenes in one world, in place of `update` of each. The farthest is drawn first, each scene is blended
// over those behind it, and its rays end at their surfaces, so that opaque parts hide one another correctly even where
// scenes interlock. Where soft parts of several scenes overlap, they are blended in the order of the scenes, not of the
// parts.
import * as THREE from 'three';
import type { TesseraScene } from './scene';

export function updateScenes(scenes: readonly TesseraScene[], camera: THREE.Camera, renderer: THREE.WebGLRenderer): void {
  const eye = eyePosition(camera);
  const farthestFirst = scenes
    .filter((scene) => scene.visible)
    .map((scene) => ({ scene, distance: distanceTo(scene, eye) }))
    .sort((a, b) => b.distance - a.distance);
  const behind: TesseraScene[] = [];
  for (const { scene } of farthestFirst) {
    const worldToLocal = scene.matrixWorld.clone().invert();
    // Where another scene is captured and visible, it is shown in place of this scene's background block. The boxes
    // are ordered nearest first.
    const boxes = [...farthestFirst]
      .reverse()
      .filter((other) => other.scene !== scene && other.scene.complete && (other.scene.statistics?.resident ?? 0) > 0)
      .map((other) => worldToLocal.clone().multiply(other.scene.matrixWorld).multiply(localFromCube(other.scene)));
    scene.neighbours = { behind: [...behind], boxes };
    scene.update(camera, renderer);
    behind.push(scene);
  }
}

// Returns the position of the camera, or the mean position of an ArrayCamera's cameras, whose own position three.js
// does not use.
function eyePosition(camera: THREE.Camera): THREE.Vector3 {
  camera.updateWorldMatrix(true, false);
  const cameras = camera instanceof THREE.ArrayCamera ? camera.cameras : [camera];
  const sum = cameras.reduce((all, one) => all.add(new THREE.Vector3().setFromMatrixPosition(one.matrixWorld)), new THREE.Vector3());
  return sum.divideScalar(cameras.length);
}

// Returns the matrix from the unit cube to the scene's object, for the scene's bounding box.
function localFromCube({ tileset, localFromScene }: TesseraScene): THREE.Matrix4 {
  const box = new THREE.Box3(new THREE.Vector3(...tileset.box.low), new THREE.Vector3(...tileset.box.high));
  const { x, y, z } = box.getSize(new THREE.Vector3());
  const sceneFromCube = new THREE.Matrix4().makeScale(x, y, z).setPosition(box.getCenter(new THREE.Vector3()));
  return localFromScene.clone().multiply(sceneFromCube);
}

function distanceTo(scene: TesseraScene, eye: THREE.Vector3): number {
  scene.updateWorldMatrix(true, false);
  return scene.bounds.applyMatrix4(scene.matrixWorld).distanceToPoint(eye);
}
