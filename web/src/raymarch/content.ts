// The in-memory form of contents that are drawn by ray marching (docs/tile-format.md, sections 6 and 7), in the layout
// that the GPU uses.
//
// A texel has 8 attributes in two textures of 4 bytes: the first holds diffuse red, green, blue and density, the second
// the 4 features.
import type { ContentHeader } from '../tiles/content-codec';
import type { Vec3 } from '../tiles/tileset';

export const kMacroblock = 8; // texels along an edge
export const kStoredEdge = 9; // one more at the upper end: the apron
export const kAttributes = 8;

export interface ContentPart {
  centre: Vec3;
  scale: Vec3;
  contracted: boolean;
  backgroundBlock: boolean;
  low: Vec3; // the region it owns, in scene units
  high: Vec3;
  stored: number; // macroblocks
}

// The header or content of either representation.
export interface MarchedHeader extends ContentHeader {
  parts: ContentPart[];
}

export interface MarchedContent {
  parts: ContentPart[];
  macroblocks: Cubes<Uint8Array>; // where each macroblock lies in its atlas
}

// A 3D texture, x fastest, that holds one cube per part. The cube of part n begins at origins[n].
export interface Cubes<Texels> {
  size: Vec3;
  origins: Vec3[];
  texels: Texels;
}

export interface TexelTextures {
  size: Vec3; // texels
  first: Uint8Array; // [z][y][x][4]
  second: Uint8Array;
}

export const kTexturesOfShader = 16; // guaranteed by WebGL 2

export function count(size: Vec3): number {
  return size[0] * size[1] * size[2];
}

export function emptyTextures(size: Vec3): TexelTextures {
  return { size, first: new Uint8Array(4 * count(size)), second: new Uint8Array(4 * count(size)) };
}

// Copies the numbers of a cube, `numbers` of them per texel, to its place among the others.
export function putCube<Texels extends Uint8Array | Uint32Array>(
  from: Texels, edge: number, to: Cubes<Texels>, n: number, numbers = 1,
): void {
  const [x0, y0, z0] = to.origins[n];
  for (let z = 0; z < edge; ++z) {
    for (let y = 0; y < edge; ++y) {
      const row = numbers * edge * (y + edge * z);
      const place = numbers * (x0 + to.size[0] * (y0 + y + to.size[1] * (z0 + z)));
      to.texels.set(from.subarray(row, row + numbers * edge), place);
    }
  }
}
