import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { Rig, type Head } from './rig';

function head(x: number, y: number, z: number, yaw: number, pitch = 0): Head {
  const orientation = new THREE.Quaternion().setFromEuler(new THREE.Euler(pitch, yaw, 0, 'YXZ'));
  return { position: { x, y, z }, orientation };
}

function expectNear(a: THREE.Vector3, ...b: [number, number, number]): void {
  a.toArray().forEach((value, axis) => expect(value).toBeCloseTo(b[axis], 9));
}

describe('the pose of a headset', () => {
  it('is the given place and heading, wherever in the play space the head is', () => {
    const rig = new Rig(1);
    const one = head(0.4, 1.6, -0.3, 0.7, -0.2);
    rig.place(one, new THREE.Vector3(10, 20, 30), Math.PI / 2);
    expectNear(rig.eyePosition(one), 10, 20, 30);
    expectNear(rig.gazeDirection(one), -Math.cos(0.2), -Math.sin(0.2), 0);
    expect(rig.computeHeading(one)).toBeCloseTo(Math.PI / 2, 9);
  });

  it('keeps its place while the user turns', () => {
    const rig = new Rig(1);
    const one = head(1, 1.7, 2, 0.3);
    rig.place(one, new THREE.Vector3(5, 6, 7), 0);
    rig.turn(one, Math.PI / 6);
    expectNear(rig.eyePosition(one), 5, 6, 7);
    expectNear(rig.gazeDirection(one), -0.5, 0, -Math.sqrt(0.75));
  });

  it('moves by true distances in a world of other units', () => {
    const rig = new Rig(0.1);
    rig.place(head(0, 1.6, 0, 0), new THREE.Vector3(), 0);
    expectNear(rig.eyePosition(head(0, 1.6, -1, 0)), 0, 0, -0.1);
    rig.move(new THREE.Vector3(3, 0, 0));
    expectNear(rig.eyePosition(head(0, 1.6, 0, 0)), 3, 0, 0);
  });
});
