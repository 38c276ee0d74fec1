import * as THREE from 'three';
import { describe, expect, it } from 'vitest';
import { viewUniforms } from '../../raymarch/content-program';
import { NetworkPass } from './network-pass';

const kUnusedNetworks = 16; // a number of unused networks that NetworkPass keeps

function pass() {
  return new NetworkPass(new THREE.WebGLRenderTarget(1, 1, { count: 4 }), new THREE.BufferGeometry(), viewUniforms(), 0);
}

// A network with one layer of 7 inputs and 16 harmonics.
function network(bias: number) {
  return [{ inputs: 23, outputs: 3, weights: new Float32Array(69), biases: new Float32Array(3).fill(bias) }];
}

function holding(networks: NetworkPass, bias: number) {
  const drawnNetwork = networks.getDrawnNetwork(network(bias));
  ++drawnNetwork.contents;
  return drawnNetwork;
}

describe('the networks of a hash scene', () => {
  it('are shared by contents with equal numbers', () => {
    const networks = pass();
    expect(networks.getDrawnNetwork(network(1))).toBe(networks.getDrawnNetwork(network(1)));
    expect(networks.getDrawnNetwork(network(2))).not.toBe(networks.getDrawnNetwork(network(1)));
  });

  it('are kept while a content uses them, and up to a number of unused ones', () => {
    const networks = pass();
    const drawn = holding(networks, 0);
    holding(networks, 0); // a second content
    networks.release(drawn);
    const disposed: number[] = [];
    const others = [...new Array(kUnusedNetworks + 3).keys()].map((n) => holding(networks, n + 1));
    others.forEach(({ mesh }, n) => mesh.material.addEventListener('dispose', () => disposed.push(n)));
    for (const other of others) networks.release(other);
    expect(disposed).toEqual([0, 1, 2]);
    expect(networks.getDrawnNetwork(network(0))).toBe(drawn);
    others.forEach((other, n) => expect(networks.getDrawnNetwork(network(n + 1)) === other).toBe(n > 2));
  });
});
