// Where the room of somebody with a headset stands in the world. What the headset tells of the head is in the room.
import * as THREE from 'three';

export class Rig {
  readonly room = new THREE.Group(); // holds the camera

  // The room is in metres, whatever the world is in.
  constructor(unitsPerMetre: number) {
    this.room.name = 'headset';
    this.room.userData.isTool = true;
    this.room.scale.setScalar(unitsPerMetre);
  }

  // Has the head stand at a place and look, over the ground, in a direction (radians to the left of -z).
  place(head: Head, eye: THREE.Vector3, heading: number): void {
    this.room.rotation.y = heading - headingOf(head.orientation);
    this.room.updateMatrix();
    this.move(eye.clone().sub(this.eyeOf(head)));
  }

  // Radians, to the left, where one stands.
  turn(head: Head, radians: number): void {
    this.place(head, this.eyeOf(head), this.headingOf(head) + radians);
  }

  move(way: THREE.Vector3): void {
    this.room.position.add(way);
    this.room.updateMatrix();
  }

  // In the world.
  eyeOf({ position: { x, y, z } }: Head): THREE.Vector3 {
    return new THREE.Vector3(x, y, z).applyMatrix4(this.room.matrix);
  }

  gazeOf({ orientation }: Head): THREE.Vector3 {
    return new THREE.Vector3(0, 0, -1).applyQuaternion(quaternion(orientation)).applyQuaternion(this.room.quaternion);
  }

  headingOf({ orientation }: Head): number {
    return this.room.rotation.y + headingOf(orientation);
  }
}

type Vector = Pick<DOMPointReadOnly, 'x' | 'y' | 'z'>;
type Quaternion = Vector & Pick<DOMPointReadOnly, 'w'>;

// In the room, as an XRRigidTransform has it.
export interface Head {
  position: Vector;
  orientation: Quaternion;
}

function quaternion({ x, y, z, w }: Quaternion): THREE.Quaternion {
  return new THREE.Quaternion(x, y, z, w);
}

function headingOf(orientation: Quaternion): number {
  return new THREE.Euler().setFromQuaternion(quaternion(orientation), 'YXZ').y;
}
