// One content of a `mesh` scene in memory, in the layout that the GPU uses. docs/tile-format.md, section 8, is normative
// for its meaning.
import type { DenseLayer } from '../../tiles/network';
import type { Vec3 } from '../../tiles/tileset';

export const kFeatures = 8; // of a texel
export const kCornerNumbers = 12; // of the four corners of a patch

export interface MeshPart {
  patchEdge: number; // texels
  patches: number;
  pairs: number; // patches with two triangles, which come first
  origin: Vec3; // the number v of a vertex along an axis stands for origin + step · v, in scene units
  step: number;
  ranges: readonly (readonly [number, number])[]; // of the features
  network: DenseLayer[]; // features and harmonics of the direction → … → 3
}

// The textures of a part.
export interface MeshTexels {
  vertices: Uint16Array; // [patches][4][3]; corner 3 of a patch with one triangle has no meaning
  // If compressed, four textures in BC5, of two features each; otherwise two of four bytes.
  features: Uint8Array[];
  opacity: Uint8Array; // in BC4, or bytes
}

export interface MeshContent {
  isCompressed: boolean;
  parts: MeshPart[];
  texels: MeshTexels[]; // of each part
  skyEdge: number; // 0: none
  sky: Uint8Array; // [6 sides][row][column][4]; the fourth byte has no meaning
}

// Returns the patches in a row of a texture: the smallest number whose square is at least `patches`.
export function patchesAcross({ patches }: Pick<MeshPart, 'patches'>): number {
  const root = Math.floor(Math.sqrt(patches));
  return root * root === patches ? root : root + 1;
}

// Returns the width and height of the textures of a part, in texels.
export function textureSize(part: Pick<MeshPart, 'patches' | 'patchEdge'>): [number, number] {
  const across = patchesAcross(part);
  return part.patches === 0 ? [0, 0] : [across * part.patchEdge, Math.ceil(part.patches / across) * part.patchEdge];
}
