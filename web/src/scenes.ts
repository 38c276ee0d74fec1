// Several scenes in one world, instead of `update` of each: the farthest first, so that each is blended over those behind
// it, and its rays end at their surfaces, so that where they interlock each opaque part hides what is behind it. Where
// soft parts of several overlap, they are blended in the order of the scenes, not of the parts.
import * as THREE from 'three';
import type { TesseraScene } from './scene';

export function updateScenes(scenes: readonly TesseraScene[], camera: THREE.Camera, renderer: THREE.WebGLRenderer): void {
  const eye = eyeOf(camera);
  const farthestFirst = scenes
    .filter((scene) => scene.visible)
    .map((scene) => ({ scene, distance: distanceTo(scene, eye) }))
    .sort((a, b) => b.distance - a.distance);
  const behind: TesseraScene[] = [];
  for (const { scene } of farthestFirst) {
    const worldToLocal = scene.matrixWorld.clone().invert();
    // What was captured there, and can be seen, is better than what the surround makes of it. The nearest first.
    const boxes = [...farthestFirst]
      .reverse()
      .filter((other) => other.scene !== scene && other.scene.complete && (other.scene.statistics?.resident ?? 0) > 0)
      .map((other) => worldToLocal.clone().multiply(other.scene.matrixWorld).multiply(boxOf(other.scene)));
    scene.neighbours = { behind: [...behind], boxes };
    scene.update(camera, renderer);
    behind.push(scene);
  }
}

// Of several cameras, amid them: three does not ask where an ArrayCamera itself is.
function eyeOf(camera: THREE.Camera): THREE.Vector3 {
  camera.updateWorldMatrix(true, false);
  const cameras = camera instanceof THREE.ArrayCamera ? camera.cameras : [camera];
  const sum = cameras.reduce((all, one) => all.add(new THREE.Vector3().setFromMatrixPosition(one.matrixWorld)), new THREE.Vector3());
  return sum.divideScalar(cameras.length);
}

// From the cube of edge 1 to the scene's object.
function boxOf({ tileset, localFromScene }: TesseraScene): THREE.Matrix4 {
  const box = new THREE.Box3(new THREE.Vector3(...tileset.box.low), new THREE.Vector3(...tileset.box.high));
  const { x, y, z } = box.getSize(new THREE.Vector3());
  const sceneFromCube = new THREE.Matrix4().makeScale(x, y, z).setPosition(box.getCenter(new THREE.Vector3()));
  return localFromScene.clone().multiply(sceneFromCube);
}

function distanceTo(scene: TesseraScene, eye: THREE.Vector3): number {
  scene.updateWorldMatrix(true, false);
  return scene.bounds.applyMatrix4(scene.matrixWorld).distanceToPoint(eye);
}
