// Places the play space of a headset in the world. Poses of the headset are relative to the play space.
import * as THREE from 'three';

export class Rig {
  readonly playSpace = new THREE.Group(); // contains the camera

  // The play space is in metres, whatever the unit of the world.
  constructor(unitsPerMetre: number) {
    this.playSpace.name = 'headset';
    this.playSpace.userData.isTool = true;
    this.playSpace.scale.setScalar(unitsPerMetre);
  }

  // Moves the play space so that the head is at `eye` and faces a horizontal direction (radians to the left of -z).
  place(head: Head, eye: THREE.Vector3, heading: number): void {
    this.playSpace.rotation.y = heading - computeHeading(head.orientation);
    this.playSpace.updateMatrix();
    this.move(eye.clone().sub(this.eyePosition(head)));
  }

  // Turns by `radians` to the left about the head.
  turn(head: Head, radians: number): void {
    this.place(head, this.eyePosition(head), this.computeHeading(head) + radians);
  }

  move(way: THREE.Vector3): void {
    this.playSpace.position.add(way);
    this.playSpace.updateMatrix();
  }

  // Returns the position in the world.
  eyePosition({ position: { x, y, z } }: Head): THREE.Vector3 {
    return new THREE.Vector3(x, y, z).applyMatrix4(this.playSpace.matrix);
  }

  gazeDirection({ orientation }: Head): THREE.Vector3 {
    return new THREE.Vector3(0, 0, -1).applyQuaternion(quaternion(orientation)).applyQuaternion(this.playSpace.quaternion);
  }

  computeHeading({ orientation }: Head): number {
    return this.playSpace.rotation.y + computeHeading(orientation);
  }
}

type Vector = Pick<DOMPointReadOnly, 'x' | 'y' | 'z'>;
type Quaternion = Vector & Pick<DOMPointReadOnly, 'w'>;

// A pose in the play space, in the form of XRRigidTransform.
export interface Head {
  position: Vector;
  orientation: Quaternion;
}

function quaternion({ x, y, z, w }: Quaternion): THREE.Quaternion {
  return new THREE.Quaternion(x, y, z, w);
}

function computeHeading(orientation: Quaternion): number {
  return new THREE.Euler().setFromQuaternion(quaternion(orientation), 'YXZ').y;
}
