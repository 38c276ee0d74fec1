// A content's network: layers, and the same as vectors of four numbers, which shaders take.
import type { Broken } from './tileset-rules';

export interface DenseLayer {
  inputs: number;
  outputs: number;
  weights: Float32Array; // [outputs][inputs]
  biases: Float32Array; // [outputs]
}

// For each layer and each four outputs together, their biases, then their weights for each input.
export function packNetwork(network: DenseLayer[]): Float32Array {
  const packed: number[] = [];
  for (const { inputs, outputs, weights, biases } of network) {
    for (let first = 0; first < outputs; first += 4) {
      const four = [first, first + 1, first + 2, first + 3];
      for (const o of four) packed.push(o < outputs ? biases[o] : 0);
      for (let i = 0; i < inputs; ++i) {
        for (const o of four) packed.push(o < outputs ? weights[o * inputs + i] : 0);
      }
    }
  }
  return new Float32Array(packed);
}

// How many vectors that makes.
export function networkVectors(network: Pick<DenseLayer, 'inputs' | 'outputs'>[]): number {
  return network.reduce((sum, { inputs, outputs }) => sum + Math.ceil(outputs / 4) * (1 + inputs), 0);
}

export const kMostLayers = 8;
export const kMostLayerWidth = 256;
export const kMostNetworkVectors = 4096; // of a network, as shaders take it
const kOutputs = 3;

// The first rule that is broken, for people.
export function ruleOfNetwork(network: DenseLayer[], inputs: number): Broken {
  if (network.length < 1) return 'the network has no layers';
  let width = inputs;
  for (const layer of network) {
    if (layer.inputs !== width || layer.outputs < 1) return "the network's layers do not follow one another";
    width = layer.outputs;
    if (!layer.weights.every(Number.isFinite) || !layer.biases.every(Number.isFinite)) {
      return 'the network holds a number that is not finite';
    }
  }
  if (width !== kOutputs) return 'the network does not end in a colour';
  return networkVectors(network) > kMostNetworkVectors ? 'the network is larger than a shader takes' : undefined;
}
