// A content's network: its layers, and the same numbers packed as vectors of four for shaders.
import type { Broken } from './tileset-rules';

export interface DenseLayer {
  inputs: number;
  outputs: number;
  weights: Float32Array; // [outputs][inputs]
  biases: Float32Array; // [outputs]
}

// Packs each layer in groups of four outputs: their biases, then their weights for each input.
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

// Returns the number of packed vectors.
export function networkVectors(network: Pick<DenseLayer, 'inputs' | 'outputs'>[]): number {
  return network.reduce((sum, { inputs, outputs }) => sum + Math.ceil(outputs / 4) * (1 + inputs), 0);
}

export const kMaxLayers = 8;
export const kMaxLayerWidth = 256;
export const kMaxNetworkVectors = 4096; // the largest packed network that shaders accept
const kOutputs = 3;

// Returns the first violated rule as text for users.
export function ruleOfNetwork(network: DenseLayer[], inputs: number): Broken {
  if (network.length < 1) return 'the network has no layers';
  let width = inputs;
  for (const layer of network) {
    if (layer.inputs !== width || layer.outputs < 1) return "the network's layers do not follow one another";
    width = layer.outputs;
    if (!layer.weights.every(Number.isFinite) || !layer.biases.every(Number.isFinite)) {
      return 'the network contains a number that is not finite';
    }
  }
  if (width !== kOutputs) return 'the network does not end in a colour';
  return networkVectors(network) > kMaxNetworkVectors ? 'the network is too large for a shader' : undefined;
}
