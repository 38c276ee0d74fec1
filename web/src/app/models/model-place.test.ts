import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { kYUpFromZUp } from '../../axes';
import { getPlace, setPlace } from './model-place';

function composed({ position, rotation, scale }: ReturnType<typeof getPlace>): THREE.Matrix4 {
  return new THREE.Matrix4().compose(
    new THREE.Vector3(...position), new THREE.Quaternion(...rotation), new THREE.Vector3(...scale));
}

describe('getPlace', () => {
  const base = new THREE.Vector3(1, -2, 3);
  const holder = new THREE.Object3D();
  holder.position.set(10, 20, -30);
  holder.quaternion.setFromEuler(new THREE.Euler(0.3, 1.2, -0.7, 'YXZ'));
  holder.scale.set(1, 2, 3);

  it("converts the holder's pose to a world with z up", () => {
    holder.updateMatrix();
    const world = holder.matrix.clone().multiply(new THREE.Matrix4().makeTranslation(base.clone().negate()));
    const expected = kYUpFromZUp.clone().invert().multiply(world).multiply(kYUpFromZUp);
    composed(getPlace(holder, base)).elements.forEach((x, i) => expect(x).toBeCloseTo(expected.elements[i], 9));
  });

  it('is the inverse of setPlace', () => {
    const again = new THREE.Object3D();
    setPlace(again, base, getPlace(holder, base));
    expect(again.position.distanceTo(holder.position)).toBeLessThan(1e-9);
    expect(again.quaternion.angleTo(holder.quaternion)).toBeLessThan(1e-6);
    expect(again.scale.distanceTo(holder.scale)).toBeLessThan(1e-9);
  });

  it('returns no rotation for an upright model', () => {
    const upright = new THREE.Object3D();
    upright.position.set(1, 2, 3);
    const { position, rotation } = getPlace(upright, new THREE.Vector3());
    expect([...position, ...rotation].map((x) => x + 0)).toEqual([1, -3, 2, 0, 0, 0, 1]);
  });
});
