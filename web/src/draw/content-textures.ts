// A content on the graphics card: allocated at once, filled slice by slice, so that no frame waits for a whole block.
import * as THREE from 'three';
import type { Vec3 } from '../tiles/tileset';
import { kVectorsOfPart, type VolumeContent, type VolumePart } from '../tiles/volume-content';
import { packNetwork } from './network-shader';

interface Slice {
  texture: THREE.Data3DTexture | THREE.DataArrayTexture;
  target: 'TEXTURE_3D' | 'TEXTURE_2D_ARRAY';
  format: 'RGBA' | 'RED';
  row: number; // from here on, of one layer where rows do not cover it
  rows: number;
  layer: number;
  layers: number;
  texels: Uint8Array;
}

const kSliceBytes = 1 << 19;

export class ContentTextures {
  readonly planesFirst: THREE.DataArrayTexture;
  readonly planesSecond: THREE.DataArrayTexture;
  readonly voxelsFirst: THREE.Data3DTexture[]; // one above the other
  readonly voxelsSecond: THREE.Data3DTexture[];
  readonly macroblocks: THREE.Data3DTexture;
  readonly distances: THREE.Data3DTexture;
  readonly numbers: Float32Array; // parts and network: `content` of shaders/lib/volume_march.glsl
  readonly widths: number[]; // outputs of the network's layers
  readonly network: Float32Array; // packed: the end of `numbers`
  readonly parts: VolumePart[];
  readonly ranges: { features: number; density: number };
  readonly stepsPerTexel: number;
  private readonly origins: { macroblocks: Vec3[]; distances: Vec3[] };
  private readonly slices: Slice[] = [];

  // Keeps the texels until they are on the card, and no longer.
  constructor(content: VolumeContent) {
    const { planes, voxels, atlasDepth, macroblocks, distances } = content;
    this.parts = content.parts;
    this.ranges = { features: content.featureRange, density: content.densityRange };
    this.stepsPerTexel = content.stepsPerTexel;
    this.origins = { macroblocks: macroblocks.origins, distances: distances.origins };
    this.planesFirst = this.add(new THREE.DataArrayTexture(null, ...planes.size), planes.first, true);
    this.planesSecond = this.add(new THREE.DataArrayTexture(null, ...planes.size), planes.second, true);
    this.voxelsFirst = this.addAtlas(voxels.size, atlasDepth, voxels.first);
    this.voxelsSecond = this.addAtlas(voxels.size, atlasDepth, voxels.second);
    this.macroblocks = this.add(cube(macroblocks.size), macroblocks.texels, false);
    this.distances = this.add(cube(distances.size), distances.texels, false, true);
    this.widths = content.network.map((layer) => layer.outputs);
    this.network = packNetwork(content.network);
    const ofParts = 4 * kVectorsOfPart * this.parts.length;
    this.numbers = new Float32Array(ofParts + this.network.length);
    this.numbers.set(this.network, ofParts);
    this.orderParts(this.parts.map((_, n) => n));
  }

  // The parts in the order in which rays meet them.
  orderParts(order: number[]): void {
    const { macroblocks, distances } = this.origins;
    order.forEach((n, place) => {
      const part = this.parts[n];
      this.numbers.set(
        [
          ...part.centre, part.voxels, ...part.scale, part.planes, ...part.low, part.contracted ? 1 : 0,
          ...part.high, 3 * n, ...macroblocks[n], 0, ...distances[n], 0,
        ],
        4 * kVectorsOfPart * place,
      );
    });
  }

  // Takes the next slice to the card; true when there is none left.
  upload(renderer: THREE.WebGLRenderer): boolean {
    const slice = this.slices.shift();
    if (slice) {
      const gl = renderer.getContext() as WebGL2RenderingContext;
      const { texture, target, layer, layers, row, rows, texels } = slice;
      renderer.initTexture(texture);
      const { __webglTexture } = renderer.properties.get(texture) as { __webglTexture: WebGLTexture };
      renderer.state.activeTexture(gl.TEXTURE0);
      renderer.state.bindTexture(gl[target], __webglTexture);
      renderer.state.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
      renderer.state.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
      renderer.state.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
      renderer.state.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      const { width } = texture.image;
      gl.texSubImage3D(gl[target], 0, 0, row, layer, width, rows, layers, gl[slice.format], gl.UNSIGNED_BYTE, texels);
      renderer.state.unbindTexture();
    }
    return this.slices.length === 0;
  }

  dispose(): void {
    this.slices.length = 0;
    const { planesFirst, planesSecond, voxelsFirst, voxelsSecond, macroblocks, distances } = this;
    for (const texture of [planesFirst, planesSecond, ...voxelsFirst, ...voxelsSecond, macroblocks, distances]) texture.dispose();
  }

  private add<T extends THREE.Data3DTexture | THREE.DataArrayTexture>(
    texture: T, texels: Uint8Array, linear: boolean, oneByte = false,
  ): T {
    texture.format = oneByte ? THREE.RedFormat : THREE.RGBAFormat;
    texture.type = THREE.UnsignedByteType;
    texture.internalFormat = oneByte ? 'R8' : 'RGBA8';
    texture.colorSpace = THREE.NoColorSpace;
    texture.minFilter = texture.magFilter = linear ? THREE.LinearFilter : THREE.NearestFilter;
    texture.generateMipmaps = false;
    texture.unpackAlignment = 1;
    texture.source.dataReady = false; // storage alone: texels come slice by slice
    texture.needsUpdate = true;
    this.cut(texture, texels, oneByte ? 1 : 4);
    return texture;
  }

  private addAtlas([width, height, depth]: Vec3, most: number, texels: Uint8Array): THREE.Data3DTexture[] {
    const layer = 4 * width * height;
    return Array.from({ length: atlasesOf(depth, most) }, (_, n) => {
      const [from, to] = [n * most, Math.min((n + 1) * most, depth)];
      return this.add(cube([width, height, to - from]), texels.subarray(from * layer, to * layer), true);
    });
  }

  private cut(texture: Slice['texture'], texels: Uint8Array, bytes: number): void {
    const { width, height, depth } = texture.image;
    const bytesOfRow = bytes * width;
    const bytesOfLayer = bytesOfRow * height;
    const common = {
      texture,
      target: texture instanceof THREE.DataArrayTexture ? ('TEXTURE_2D_ARRAY' as const) : ('TEXTURE_3D' as const),
      format: bytes === 1 ? ('RED' as const) : ('RGBA' as const),
    };
    if (texels.length === 0) return;
    const layers = Math.max(1, Math.floor(kSliceBytes / bytesOfLayer));
    const rows = Math.min(height, Math.max(1, Math.floor(kSliceBytes / bytesOfRow)));
    for (let layer = 0; layer < depth; layer += layers) {
      const count = Math.min(layers, depth - layer);
      if (rows === height) {
        const part = texels.subarray(layer * bytesOfLayer, (layer + count) * bytesOfLayer);
        this.slices.push({ ...common, row: 0, rows, layer, layers: count, texels: part });
        continue;
      }
      for (let row = 0; row < height; row += rows) {
        const begin = layer * bytesOfLayer + row * bytesOfRow;
        const some = Math.min(rows, height - row);
        this.slices.push({
          ...common, row, rows: some, layer, layers: 1, texels: texels.subarray(begin, begin + some * bytesOfRow),
        });
      }
    }
  }
}

// Textures that an atlas of such a depth is cut into.
export function atlasesOf(depth: number, most: number): number {
  return Math.max(1, Math.ceil(depth / most));
}

// A texture must have texels; one without is never looked into.
function cube([x, y, z]: readonly [number, number, number]): THREE.Data3DTexture {
  return new THREE.Data3DTexture(null, Math.max(x, 1), Math.max(y, 1), Math.max(z, 1));
}
