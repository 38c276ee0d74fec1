import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { viewUniforms } from '../../raymarch/content-program';
import { NetworkPass } from './network-pass';

const kKept = 16; // that no content has

function pass() {
  return new NetworkPass(new THREE.WebGLRenderTarget(1, 1, { count: 4 }), new THREE.BufferGeometry(), viewUniforms(), 0);
}

// One layer of 7 inputs and 16 harmonics.
function network(bias: number) {
  return [{ inputs: 23, outputs: 3, weights: new Float32Array(69), biases: new Float32Array(3).fill(bias) }];
}

function holding(networks: NetworkPass, bias: number) {
  const found = networks.networkOf(network(bias));
  ++found.contents;
  return found;
}

describe('the networks of a hash scene', () => {
  it('are one for contents that have the same numbers', () => {
    const networks = pass();
    expect(networks.networkOf(network(1))).toBe(networks.networkOf(network(1)));
    expect(networks.networkOf(network(2))).not.toBe(networks.networkOf(network(1)));
  });

  it('stay while a content has them, and some of the others for when they come back', () => {
    const networks = pass();
    const drawn = holding(networks, 0);
    holding(networks, 0); // a second content
    networks.release(drawn);
    const disposed: number[] = [];
    const others = [...new Array(kKept + 3).keys()].map((n) => holding(networks, n + 1));
    others.forEach(({ mesh }, n) => mesh.material.addEventListener('dispose', () => disposed.push(n)));
    for (const other of others) networks.release(other);
    expect(disposed).toEqual([0, 1, 2]);
    expect(networks.networkOf(network(0))).toBe(drawn);
    others.forEach((other, n) => expect(networks.networkOf(network(n + 1)) === other).toBe(n > 2));
  });
});
