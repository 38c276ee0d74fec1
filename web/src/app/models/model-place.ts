// Converts the placement of a model to the form of world.json: the pose of the model's own origin in the capture's
// world, z up.
import * as THREE from 'three';
import { kYUpFromZUp } from '../../axes';
import type { WorldModel } from '../world/world-file';

export type Place = Pick<WorldModel, 'position' | 'rotation' | 'scale'>;

const kZUpFromYUp = kYUpFromZUp.clone().invert();

// `base` is the point of the model that is at the holder's origin; the holder is in the world of three.js.
export function getPlace(holder: THREE.Object3D, base: THREE.Vector3): Place {
  const position = base.clone().negate().multiply(holder.scale).applyQuaternion(holder.quaternion).add(holder.position);
  const { x, y, z, w } = holder.quaternion;
  const { x: across, y: up, z: along } = holder.scale;
  return { position: position.applyMatrix4(kZUpFromYUp).toArray(), rotation: [x, -z, y, w], scale: [across, along, up] };
}

export function setPlace(holder: THREE.Object3D, base: THREE.Vector3, { position, rotation: [x, y, z, w], scale }: Place): void {
  holder.quaternion.set(x, z, -y, w);
  holder.scale.set(scale[0], scale[2], scale[1]);
  holder.position.fromArray(position).applyMatrix4(kYUpFromZUp);
  holder.position.add(base.clone().multiply(holder.scale).applyQuaternion(holder.quaternion));
}
