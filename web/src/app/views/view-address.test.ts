import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { formatView, parseView } from './view-address';

describe('a view in the address', () => {
  it('restores the view', () => {
    const view = { eye: new THREE.Vector3(1.5, 20.25, -3), target: new THREE.Vector3(-4, 0, 7.125), fov: 62.5 };
    const again = parseView(`#${formatView(view)}`)!;
    expect(again.eye.distanceTo(view.eye)).toBeLessThan(1e-3);
    expect(again.target.distanceTo(view.target)).toBeLessThan(1e-3);
    expect(again.fov).toBe(62.5);
  });

  it('is in the world of the capture, z up', () => {
    expect(formatView({ eye: new THREE.Vector3(1, 20, -3), target: new THREE.Vector3(), fov: 50 })).toBe(
      'eye=1,3,20&target=0,0,0&fov=50');
  });

  it.each([
    '', '#', '#eye=1,2,3', '#eye=1,2,3&target=1,2', '#eye=1,2,3&target=1,2,x', '#eye=1,2,3&target=1,2,3', '#eye=1,2,3&target=NaN,0,0',
    '#eye=1,2,1e400&target=0,0,0', '#eye=,,&target=0,0,0',
  ])('is rejected: %j', (text) => {
    expect(parseView(text)).toBeUndefined();
  });

  it('has the default field of view if that is missing or invalid', () => {
    expect(parseView('eye=1,2,3&target=0,0,0&fov=500')!.fov).toBe(50);
  });
});
