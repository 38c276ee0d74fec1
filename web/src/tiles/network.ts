// A content's network as vectors of four numbers, which shaders take.
import type { DenseLayer } from './content';

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
