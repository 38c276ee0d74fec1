// The textures of a content on the GPU: allocated at once and filled slice by slice, so that no frame waits for a whole
// block.
import * as THREE from 'three';
import type { Vec3 } from '../tiles/tileset';
import type { ContentPart, Cubes, TexelTextures } from './content';

type Texture = THREE.Data3DTexture | THREE.DataArrayTexture;
type Texels = Uint8Array | Uint32Array;

interface Slice {
  texture: Texture;
  form: TexelForm;
  row: number; // first row of the slice, within one layer unless rows cover it
  rows: number;
  layer: number;
  layers: number;
  texels: Texels;
}

const kSliceBytes = 1 << 19;

// The format of texels on the GPU.
interface TexelForm {
  internal: THREE.PixelFormatGPU;
  format: THREE.AnyPixelFormat;
  type: THREE.TextureDataType;
  gl: { format: 'RGBA' | 'RED' | 'RED_INTEGER' | 'RG_INTEGER'; type: 'UNSIGNED_BYTE' | 'UNSIGNED_INT' };
  numbers: number; // components of a texel
}

const kBytes = { type: THREE.UnsignedByteType } as const;
const kWords = { type: THREE.UnsignedIntType } as const;
export const kForms = {
  fourBytes: { ...kBytes, internal: 'RGBA8', format: THREE.RGBAFormat, numbers: 4, gl: { format: 'RGBA', type: 'UNSIGNED_BYTE' } },
  oneByte: { ...kBytes, internal: 'R8', format: THREE.RedFormat, numbers: 1, gl: { format: 'RED', type: 'UNSIGNED_BYTE' } },
  wholeWord: { ...kWords, internal: 'R32UI', format: THREE.RedIntegerFormat, numbers: 1, gl: { format: 'RED_INTEGER', type: 'UNSIGNED_INT' } },
  twoWords: { ...kWords, internal: 'RG32UI', format: THREE.RGIntegerFormat, numbers: 2, gl: { format: 'RG_INTEGER', type: 'UNSIGNED_INT' } },
} satisfies Record<string, TexelForm>;

export abstract class ContentTextures<Part extends ContentPart = ContentPart> {
  abstract readonly numbers: Float32Array; // the uniform `content` that the representation's march in shaders/lib reads
  private readonly textures: Texture[] = [];
  private readonly slices: Slice[] = [];

  protected constructor(readonly parts: Part[]) {}

  // The parts in the order in which rays meet them.
  abstract orderParts(order: number[]): void;

  // The uniforms that the representation's march reads, without `content`.
  abstract uniforms(): Record<string, THREE.IUniform>;

  // Uploads the next slice to the GPU; returns true when none is left.
  upload(renderer: THREE.WebGLRenderer): boolean {
    const slice = this.slices.shift();
    if (slice) {
      const gl = renderer.getContext() as WebGL2RenderingContext;
      const { texture, form, layer, layers, row, rows, texels } = slice;
      renderer.initTexture(texture);
      const { __webglTexture } = renderer.properties.get(texture) as { __webglTexture: WebGLTexture };
      const target = gl[texture instanceof THREE.DataArrayTexture ? 'TEXTURE_2D_ARRAY' : 'TEXTURE_3D'];
      renderer.state.activeTexture(gl.TEXTURE0);
      renderer.state.bindTexture(target, __webglTexture);
      renderer.state.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
      renderer.state.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
      renderer.state.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
      renderer.state.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      const { width } = texture.image;
      gl.texSubImage3D(target, 0, 0, row, layer, width, rows, layers, gl[form.gl.format], gl[form.gl.type], texels);
      renderer.state.unbindTexture();
    }
    return this.slices.length === 0;
  }

  dispose(): void {
    this.slices.length = 0;
    for (const texture of this.textures) texture.dispose();
  }

  // Keeps the texels only until they are on the GPU. `filtered` selects linear filtering.
  protected add<T extends Texture>(texture: T, form: TexelForm, texels: Texels, filtered = false): T {
    texture.format = form.format;
    texture.type = form.type;
    texture.internalFormat = form.internal;
    texture.colorSpace = THREE.NoColorSpace;
    texture.minFilter = texture.magFilter = filtered ? THREE.LinearFilter : THREE.NearestFilter;
    texture.generateMipmaps = false;
    texture.unpackAlignment = 1;
    texture.source.dataReady = false; // allocates storage only: the texels follow slice by slice
    texture.needsUpdate = true;
    this.textures.push(texture);
    this.cut(texture, form, texels);
    return texture;
  }

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

  private cut(texture: Texture, form: TexelForm, texels: Texels): void {
    if (texels.length === 0) return;
    const { width, height, depth } = texture.image;
    const numbersOfRow = form.numbers * width;
    const numbersOfLayer = numbersOfRow * height;
    const numbersOfSlice = kSliceBytes / texels.BYTES_PER_ELEMENT;
    const layers = Math.max(1, Math.floor(numbersOfSlice / numbersOfLayer));
    const rows = Math.min(height, Math.max(1, Math.floor(numbersOfSlice / numbersOfRow)));
    for (let layer = 0; layer < depth; layer += layers) {
      const count = Math.min(layers, depth - layer);
      if (rows === height) {
        const part = texels.subarray(layer * numbersOfLayer, (layer + count) * numbersOfLayer);
        this.slices.push({ texture, form, row: 0, rows, layer, layers: count, texels: part });
        continue;
      }
      for (let row = 0; row < height; row += rows) {
        const begin = layer * numbersOfLayer + row * numbersOfRow;
        const some = Math.min(rows, height - row);
        const part = texels.subarray(begin, begin + some * numbersOfRow);
        this.slices.push({ texture, form, row, rows: some, layer, layers: 1, texels: part });
      }
    }
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
