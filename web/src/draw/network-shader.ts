// The deferred network of a content as GLSL and numbers (docs/tile-format.md, section 6). Its loops are written out:
// shaders index arrays slowly, and vectors not at all.
import type { DenseLayer } from '../tiles/volume-content';

// Vectors of four: for each layer and each four outputs together, their biases, then their weights for each input.
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

const kNetworkInputs = 34;

// How many vectors that makes.
export function vectorsOfNetwork(widths: number[]): number {
  return widths.reduce((sum, width, layer) => sum + Math.ceil(width / 4) * (1 + (widths[layer - 1] ?? kNetworkInputs)), 0);
}

// One number as GLSL writes it, to a float's digits.
function literal(x: number): string {
  const text = x.toPrecision(9);
  return /[.e]/.test(text) ? text : `${text}.0`;
}

// `vec3 deferred(vec3 diffuse, vec4 features, vec3 d)`. `widths` are the layers' numbers of outputs, `vector` says in GLSL
// what the nth packed vector is: a place where it is read, or its numbers (`writtenVector`).
export function networkShader(widths: number[], vector: (n: number) => string): string {
  const lines = ['vec3 deferred(vec3 diffuse, vec4 features, vec3 d) {', '  vec3 s0 = sin(d), c0 = cos(d);'];
  for (let k = 1; k < 4; ++k) lines.push(`  vec3 s${k} = 2.0 * s${k - 1} * c${k - 1}, c${k} = 1.0 - 2.0 * s${k - 1} * s${k - 1};`);
  const xyz = (name: string) => ['x', 'y', 'z'].map((axis) => `${name}.${axis}`);
  let inputs = [
    ...xyz('diffuse'), ...xyz('features'), 'features.w', ...xyz('d'),
    ...['s0', 's1', 's2', 's3', 'c0', 'c1', 'c2', 'c3'].flatMap(xyz),
  ];
  let at = 0;
  widths.forEach((width, layer) => {
    const outputs: string[] = [];
    for (let group = 0; 4 * group < width; ++group) {
      const name = `h${layer}_${group}`;
      lines.push(`  vec4 ${name} = ${vector(at++)};`);
      for (const input of inputs) lines.push(`  ${name} += ${input} * ${vector(at++)};`);
      if (layer + 1 < widths.length) lines.push(`  ${name} = max(${name}, 0.0);`);
      outputs.push(...['x', 'y', 'z', 'w'].map((axis) => `${name}.${axis}`));
    }
    inputs = outputs.slice(0, width);
  });
  lines.push(`  return 1.0 / (1.0 + exp(-vec3(${inputs.join(', ')})));`, '}');
  return lines.join('\n');
}

export function writtenVector(packed: Float32Array, n: number): string {
  return `vec4(${Array.from(packed.subarray(4 * n, 4 * n + 4), literal).join(', ')})`;
}
