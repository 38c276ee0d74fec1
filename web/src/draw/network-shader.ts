// Writes the layers of a content's network as GLSL. The loops are unrolled: shaders index arrays slowly and cannot
// index vectors.
import type { DenseLayer } from '../tiles/network';

// The first 16 real spherical harmonics of the direction d as GLSL, in the order of tiny-cuda-nn.
export const kHarmonics = [
  '0.28209479', '-0.48860251 * d.y', '0.48860251 * d.z', '-0.48860251 * d.x', '1.09254843 * d.x * d.y', '-1.09254843 * d.y * d.z',
  '0.94617470 * d.z * d.z - 0.31539157', '-1.09254843 * d.x * d.z', '0.54627422 * (d.x * d.x - d.y * d.y)',
  '0.59004359 * d.y * (d.y * d.y - 3.0 * d.x * d.x)', '2.89061144 * d.x * d.y * d.z', '0.45704580 * d.y * (1.0 - 5.0 * d.z * d.z)',
  '0.37317633 * d.z * (5.0 * d.z * d.z - 3.0)', '0.45704580 * d.x * (1.0 - 5.0 * d.z * d.z)',
  '1.44530572 * d.z * (d.x * d.x - d.y * d.y)', '0.59004359 * d.x * (3.0 * d.y * d.y - d.x * d.x)',
];

// Writes a number as a GLSL float literal with full precision.
function literal(x: number): string {
  const text = x.toPrecision(9);
  return /[.e]/.test(text) ? text : `${text}.0`;
}

export function writtenVector(packed: Float32Array, n: number): string {
  return `vec4(${Array.from(packed.subarray(4 * n, 4 * n + 4), literal).join(', ')})`;
}

// Returns lines of GLSL that evaluate the layers for `inputs`, which are expressions, and the expressions of the
// outputs, before any activation of the last layer. `vector` returns the GLSL for the nth vector of the packed network
// (tiles/network.ts): a read from a buffer, or literal numbers.
export function layersShader(
  inputs: string[], network: Pick<DenseLayer, 'outputs'>[], vector: (n: number) => string,
): { lines: string[]; outputs: string[] } {
  const lines: string[] = [];
  let at = 0;
  let current = inputs;
  network.forEach(({ outputs: width }, layer) => {
    const outputs: string[] = [];
    for (let group = 0; 4 * group < width; ++group) {
      const name = `h${layer}_${group}`;
      lines.push(`  vec4 ${name} = ${vector(at++)};`);
      for (const input of current) lines.push(`  ${name} += ${input} * ${vector(at++)};`);
      if (layer + 1 < network.length) lines.push(`  ${name} = max(${name}, 0.0);`);
      outputs.push(...['x', 'y', 'z', 'w'].map((axis) => `${name}.${axis}`));
    }
    current = outputs.slice(0, width);
  });
  return { lines, outputs: current };
}
