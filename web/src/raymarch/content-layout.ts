// How a content's parts share textures, before anything is allocated for them.
import type { Vec3 } from '../tiles/tileset';
import { kStoredEdge } from './content';

export interface AtlasLayout {
  size: Vec3; // texels
  blocks: Vec3; // the same in macroblocks; places are bytes
  depth: number; // texels of it that one texture has, at most: it may be cut into several
}

// Nearly a cube, with little left over; where that is too large, higher than wide, in no more than so many textures.
// Undefined where they do not hold it.
export function atlasOf(stored: number, edge3D: number, mostTextures: number): AtlasLayout | undefined {
  const most = Math.floor(edge3D / kStoredEdge);
  const blocks = blocksOf(stored, most, mostTextures);
  if (!blocks) return undefined;
  return { size: [kStoredEdge * blocks[0], kStoredEdge * blocks[1], kStoredEdge * blocks[2]], blocks, depth: kStoredEdge * most };
}

// Textures that an atlas of such a depth is cut into.
export function texturesOf({ size, depth }: Pick<AtlasLayout, 'size' | 'depth'>): number {
  return Math.max(1, Math.ceil(size[2] / depth));
}

function blocksOf(stored: number, most: number, mostTextures: number): Vec3 | undefined {
  if (stored === 0) return [0, 0, 0];
  if (stored > most ** 3) {
    const high = Math.ceil(stored / most ** 2);
    return high <= Math.min(mostTextures * most, 256) ? [most, most, high] : undefined;
  }
  const near = Math.ceil(Math.cbrt(stored));
  let best: Vec3 | undefined;
  for (let x = near; x <= Math.min(most, near + 3); ++x) {
    for (let y = Math.max(1, near - 2); y <= x; ++y) {
      const z = Math.ceil(stored / (x * y));
      if (z <= most && (!best || x * y * z < best[0] * best[1] * best[2])) best = [x, y, z];
    }
  }
  return best;
}

// Cubes one above the other, and where that is too high, side by side.
export function stack(edges: number[], most: number): { size: Vec3; origins: Vec3[] } | undefined {
  const edge = Math.max(...edges);
  const high = Math.min(edges.length, Math.floor(most / edge));
  if (high < 1) return undefined;
  const wide = Math.ceil(edges.length / high);
  if (wide * edge > most) return undefined;
  const origins = edges.map((_, n): Vec3 => [Math.floor(n / high) * edge, 0, (n % high) * edge]);
  return { size: [wide * edge, edge, high * edge], origins };
}
