// The textures of a ray-marched content on the GPU.
import * as THREE from 'three';
import { kForms, SlicedTextures, type TexelForm, type Texels } from '../draw/sliced-textures';
import type { Vec3 } from '../tiles/tileset';
import type { ContentPart, Cubes, TexelTextures } from './content';

export abstract class ContentTextures<Part extends ContentPart = ContentPart> extends SlicedTextures {
  abstract readonly numbers: Float32Array; // the uniform `content` that the representation's march in shaders/lib reads

  protected constructor(readonly parts: Part[]) {
    super();
  }

  // The parts in the order in which rays meet them.
  abstract orderParts(order: number[]): void;

  // The uniforms that the representation's march reads, without `content`.
  abstract uniforms(): Record<string, THREE.IUniform>;

  protected addCubes({ size, texels }: Cubes<Texels>, form: TexelForm): THREE.Data3DTexture {
    return this.add(cube(size), form, texels);
  }

  // Returns both texel atlases as uniforms, which atlasShader declares under these names.
  protected addAtlas({ size, first, second }: TexelTextures, maximum: number, names: readonly [string, string]): Record<string, THREE.IUniform> {
    const uniforms = [first, second].flatMap((texels, i) =>
      this.cutAtlas(size, maximum, texels).map((value, n) => [`${names[i]}${n}`, { value }] as const));
    return Object.fromEntries(uniforms);
  }

  private cutAtlas([width, height, depth]: Vec3, maximum: number, texels: Uint8Array): THREE.Data3DTexture[] {
    const layer = 4 * width * height;
    return sliceAtlas(depth, maximum).map(([from, to]) =>
      this.add(cube([width, height, to - from]), kForms.fourBytes, texels.subarray(from * layer, to * layer), true));
  }
}

// Returns the first layer of each texture that an atlas is split into, and the layer after its last one.
function sliceAtlas(depth: number, maximum: number): [number, number][] {
  const count = Math.max(1, Math.ceil(depth / maximum));
  return Array.from({ length: count }, (_, n) => [n * maximum, Math.min((n + 1) * maximum, depth)]);
}

// Returns the uniforms that atlasShader reads besides the textures.
export function atlasUniforms([width, height, depth]: Vec3, maximum: number): Record<string, THREE.IUniform> {
  const slabs = sliceAtlas(depth, maximum).map(([from, to]) => to - from);
  const inTexture = slabs.map((layers) => new THREE.Vector3(1 / Math.max(width, 1), 1 / Math.max(height, 1), 1 / Math.max(layers, 1)));
  return { inTexture: { value: inTexture }, atlasDepth: { value: slabs[0] } };
}

// Defines a function `vec4 name(vec3 texel)` for each name, which samples an atlas that may be split into several
// stacked textures. No sample lies between two of them, as macroblocks have an apron.
export function atlasShader(names: readonly string[], textures: number): string {
  const numbers = [...Array(textures).keys()];
  const look = (name: string) => {
    const last = numbers.length - 1;
    const lines = numbers.map((n) => {
      const sample = `return textureLod(${name}${n}, x * inTexture[${n}], 0.0);`;
      return n === last ? sample : `if (x.z < atlasDepth) ${sample}\n  x.z -= atlasDepth;`;
    });
    return `vec4 ${name}(vec3 x) {\n  ${lines.join('\n  ')}\n}`;
  };
  return [
    `uniform vec3 inTexture[${textures}];  // of a texel: 1 / size\nuniform float atlasDepth;`,
    ...numbers.map((n) => `uniform sampler3D ${names.map((name) => `${name}${n}`).join(', ')};`), ...names.map(look),
  ].join('\n');
}

// A texture must have texels, so an unused one gets a single texel.
function cube([x, y, z]: Vec3): THREE.Data3DTexture {
  return new THREE.Data3DTexture(null, Math.max(x, 1), Math.max(y, 1), Math.max(z, 1));
}
