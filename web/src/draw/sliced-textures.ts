// Textures that are allocated at once and filled slice by slice, so that no frame waits for a whole content.
import * as THREE from 'three';

type ArrayTexture = THREE.DataArrayTexture | THREE.CompressedArrayTexture;
type Texture = THREE.Data3DTexture | ArrayTexture;
export type Texels = Uint8Array | Uint32Array;

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
export interface TexelForm {
  internal: THREE.PixelFormatGPU | null; // null: three.js derives it
  format: THREE.AnyPixelFormat;
  type: THREE.TextureDataType;
  gl: { format: 'RGBA' | 'RED' | 'RED_INTEGER' | 'RG_INTEGER'; type: 'UNSIGNED_BYTE' | 'UNSIGNED_INT' } | { compressed: CompressedFormat };
  numbers: number; // components of a texel, or of a block if compressed
  block: number; // texels along an edge of a block; 1 if not compressed
}

type CompressedFormat = 'COMPRESSED_RED_RGTC1_EXT' | 'COMPRESSED_RED_GREEN_RGTC2_EXT';

export const kBlockExtension = 'EXT_texture_compression_rgtc'; // of the forms that are compressed

const kBytes = { type: THREE.UnsignedByteType, block: 1 } as const;
const kWords = { type: THREE.UnsignedIntType, block: 1 } as const;
const kBlocks = { type: THREE.UnsignedByteType, internal: null, block: 4 } as const;
export const kForms = {
  fourBytes: { ...kBytes, internal: 'RGBA8', format: THREE.RGBAFormat, numbers: 4, gl: { format: 'RGBA', type: 'UNSIGNED_BYTE' } },
  oneByte: { ...kBytes, internal: 'R8', format: THREE.RedFormat, numbers: 1, gl: { format: 'RED', type: 'UNSIGNED_BYTE' } },
  wholeWord: { ...kWords, internal: 'R32UI', format: THREE.RedIntegerFormat, numbers: 1, gl: { format: 'RED_INTEGER', type: 'UNSIGNED_INT' } },
  twoWords: { ...kWords, internal: 'RG32UI', format: THREE.RGIntegerFormat, numbers: 2, gl: { format: 'RG_INTEGER', type: 'UNSIGNED_INT' } },
  bc4: { ...kBlocks, format: THREE.RED_RGTC1_Format, numbers: 8, gl: { compressed: 'COMPRESSED_RED_RGTC1_EXT' } },
  bc5: { ...kBlocks, format: THREE.RED_GREEN_RGTC2_Format, numbers: 16, gl: { compressed: 'COMPRESSED_RED_GREEN_RGTC2_EXT' } },
} satisfies Record<string, TexelForm>;

export class SlicedTextures {
  private readonly textures: Texture[] = [];
  private readonly slices: Slice[] = [];

  // Uploads the next slice to the GPU; returns true when none is left.
  upload(renderer: THREE.WebGLRenderer): boolean {
    const slice = this.slices.shift();
    if (slice) {
      const gl = renderer.getContext() as WebGL2RenderingContext;
      const { texture, form, layer, layers, row, rows, texels } = slice;
      renderer.initTexture(texture);
      const { __webglTexture } = renderer.properties.get(texture) as { __webglTexture: WebGLTexture };
      const target = gl[texture instanceof THREE.Data3DTexture ? 'TEXTURE_3D' : 'TEXTURE_2D_ARRAY'];
      renderer.state.activeTexture(gl.TEXTURE0);
      renderer.state.bindTexture(target, __webglTexture);
      const { width } = texture.image;
      if ('compressed' in form.gl) {
        const format = gl.getExtension(kBlockExtension)![form.gl.compressed];
        gl.compressedTexSubImage3D(target, 0, 0, row, layer, width, rows, layers, format, texels);
      } else {
        renderer.state.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
        renderer.state.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
        renderer.state.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
        renderer.state.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
        gl.texSubImage3D(target, 0, 0, row, layer, width, rows, layers, gl[form.gl.format], gl[form.gl.type], texels);
      }
      renderer.state.unbindTexture();
    }
    return this.slices.length === 0;
  }

  dispose(): void {
    this.slices.length = 0;
    for (const texture of this.textures) texture.dispose();
  }

  // Keeps the texels only until they are on the GPU: those of one array for all layers, or one array for each layer.
  // `filtered` selects linear filtering.
  protected add<T extends Texture>(texture: T, form: TexelForm, texels: Texels | Texels[], filtered = false): T {
    texture.format = form.format as typeof texture.format;
    texture.type = form.type;
    texture.internalFormat = form.internal;
    texture.colorSpace = THREE.NoColorSpace;
    texture.minFilter = texture.magFilter = filtered ? THREE.LinearFilter : THREE.NearestFilter;
    texture.generateMipmaps = false;
    texture.unpackAlignment = 1;
    texture.source.dataReady = false; // allocates storage only: the texels follow slice by slice
    texture.needsUpdate = true;
    this.textures.push(texture);
    if (Array.isArray(texels)) texels.forEach((ofLayer: Texels, layer) => this.cut(texture, form, ofLayer, layer, layer + 1));
    else this.cut(texture, form, texels, 0, texture.image.depth);
    return texture;
  }

  private cut(texture: Texture, form: TexelForm, texels: Texels, firstLayer: number, end: number): void {
    if (texels.length === 0) return;
    const { width, height } = texture.image;
    const { block } = form;
    const numbersOfRow = (form.numbers * width) / block; // of a row of blocks
    const numbersOfLayer = (numbersOfRow * height) / block;
    const numbersOfSlice = kSliceBytes / texels.BYTES_PER_ELEMENT;
    const layers = Math.max(1, Math.floor(numbersOfSlice / numbersOfLayer));
    const rows = Math.min(height, block * Math.max(1, Math.floor(numbersOfSlice / numbersOfRow)));
    for (let layer = firstLayer; layer < end; layer += layers) {
      const count = Math.min(layers, end - layer);
      const ofLayer = (layer - firstLayer) * numbersOfLayer;
      if (rows === height) {
        const part = texels.subarray(ofLayer, ofLayer + count * numbersOfLayer);
        this.slices.push({ texture, form, row: 0, rows, layer, layers: count, texels: part });
        continue;
      }
      for (let row = 0; row < height; row += rows) {
        const begin = ofLayer + (row / block) * numbersOfRow;
        const some = Math.min(rows, height - row);
        const part = texels.subarray(begin, begin + (some / block) * numbersOfRow);
        this.slices.push({ texture, form, row, rows: some, layer, layers: 1, texels: part });
      }
    }
  }
}
