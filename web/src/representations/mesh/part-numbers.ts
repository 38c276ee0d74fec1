// The numbers of all parts on the GPU in one texture: the ranges of their features, the colours of their tiles in display
// modes, and their networks (UE4-NeRF keeps the weights of its decoder in textures, too). A part has a row of them.
import * as THREE from 'three';
import { networkVectors, packNetwork, type DenseLayer } from '../../tiles/network';
import { kFeatures, type MeshPart } from './mesh-content';

const kWidth = 2048; // texels, which all GPUs support
export const kVectorsBeforeNetwork = kFeatures / 2 + 2; // ranges, colour of the block with the shape, colour of the level

export class PartNumbers {
  readonly texture = { value: PartNumbers.makeTexture(1) };
  readonly vectorsOfPart = { value: 1 };
  readonly shapes: DenseLayer[][] = []; // one network of each shape
  private readonly rows: (Float32Array | undefined)[] = [];

  get bytes(): number {
    return this.texture.value.image.data!.byteLength;
  }

  // Returns the row of the part, which is also its number, counted from 0, and the shape of its network.
  add({ ranges, network }: MeshPart, ofBlock: THREE.Color, ofLevel: THREE.Color): { row: number; shape: number } {
    const shape = this.shapeNumber(network);
    const numbers = new Float32Array(4 * (kVectorsBeforeNetwork + networkVectors(network)));
    ranges.forEach(([low, high], f) => {
      numbers[f] = low;
      numbers[kFeatures + f] = high - low;
    });
    numbers.set([...ofBlock.toArray(), shape, ...ofLevel.toArray(), 0], 2 * kFeatures);
    numbers.set(packNetwork(network), 4 * kVectorsBeforeNetwork);
    const free = this.rows.indexOf(undefined);
    const row = free < 0 ? this.rows.length : free;
    this.rows[row] = numbers;
    const vectors = Math.max(this.vectorsOfPart.value, numbers.length / 4);
    const capacity = this.texture.value.image.data!.length / 4;
    if (vectors > this.vectorsOfPart.value || this.rows.length * vectors > capacity) {
      this.vectorsOfPart.value = vectors;
      this.texture.value.dispose();
      this.texture.value = PartNumbers.makeTexture(2 * this.rows.length * vectors);
      this.rows.forEach((one, i) => one && this.write(i, one));
    } else {
      this.write(row, numbers);
    }
    return { row, shape };
  }

  remove(row: number): void {
    this.rows[row] = undefined;
  }

  dispose(): void {
    this.texture.value.dispose();
  }

  // Returns the number of the shape of a network: its sequence of widths.
  private shapeNumber(network: DenseLayer[]): number {
    const isSame = (other: DenseLayer[]) =>
      other.length === network.length && other.every(({ inputs, outputs }, i) => inputs === network[i].inputs && outputs === network[i].outputs);
    const known = this.shapes.findIndex(isSame);
    return known >= 0 ? known : this.shapes.push(network) - 1;
  }

  private write(row: number, numbers: Float32Array): void {
    (this.texture.value.image.data as Float32Array).set(numbers, 4 * this.vectorsOfPart.value * row);
    this.texture.value.needsUpdate = true;
  }

  private static makeTexture(vectors: number): THREE.DataTexture {
    const height = Math.ceil(vectors / kWidth);
    const texture = new THREE.DataTexture(new Float32Array(4 * kWidth * height), kWidth, height, THREE.RGBAFormat, THREE.FloatType);
    texture.minFilter = texture.magFilter = THREE.NearestFilter;
    texture.needsUpdate = true;
    return texture;
  }
}

// Declares `vec4 partVector(int part, int n)`.
export const kPartNumbersSource = `
uniform sampler2D partNumbers;
uniform int vectorsOfPart;
vec4 partVector(int part, int n) {
  int i = part * vectorsOfPart + n;
  return texelFetch(partNumbers, ivec2(i & ${kWidth - 1}, i >> ${Math.log2(kWidth)}), 0);
}`;
