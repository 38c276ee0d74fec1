// Lays out the parts of a content in shared textures, before anything is allocated for them.
import type { Vec3 } from '../tiles/tileset';
import { kStoredEdge } from './content';

export interface AtlasLayout {
  size: Vec3; // texels
  blocks: Vec3; // the same in macroblocks; places are stored in bytes
  depth: number; // layers of one texture, at most: the atlas may be split into several textures
}

// Returns an atlas close to a cube with little waste; if that is too large, one that is taller than wide, in at most
// `maxTextures` textures. Returns undefined if these cannot hold it.
export function layOutAtlas(stored: number, edge3D: number, maxTextures: number): AtlasLayout | undefined {
  const maximum = Math.floor(edge3D / kStoredEdge);
  const blocks = fitBlocks(stored, maximum, maxTextures);
  if (!blocks) return undefined;
  return { size: [kStoredEdge * blocks[0], kStoredEdge * blocks[1], kStoredEdge * blocks[2]], blocks, depth: kStoredEdge * maximum };
}

// Returns the number of textures that an atlas is split into.
export function countTextures({ size, depth }: Pick<AtlasLayout, 'size' | 'depth'>): number {
  return Math.max(1, Math.ceil(size[2] / depth));
}

function fitBlocks(stored: number, maximum: number, maxTextures: number): Vec3 | undefined {
  if (stored === 0) return [0, 0, 0];
  if (stored > maximum ** 3) {
    const high = Math.ceil(stored / maximum ** 2);
    return high <= Math.min(maxTextures * maximum, 256) ? [maximum, maximum, high] : undefined;
  }
  const near = Math.ceil(Math.cbrt(stored));
  let best: Vec3 | undefined;
  for (let x = near; x <= Math.min(maximum, near + 3); ++x) {
    for (let y = Math.max(1, near - 2); y <= x; ++y) {
      const z = Math.ceil(stored / (x * y));
      if (z <= maximum && (!best || x * y * z < best[0] * best[1] * best[2])) best = [x, y, z];
    }
  }
  return best;
}

// Stacks cubes on top of one another, and beside one another where the stack would be too high.
export function stack(edges: number[], maximum: number): { size: Vec3; origins: Vec3[] } | undefined {
  const edge = Math.max(...edges);
  const high = Math.min(edges.length, Math.floor(maximum / edge));
  if (high < 1) return undefined;
  const wide = Math.ceil(edges.length / high);
  if (wide * edge > maximum) return undefined;
  const origins = edges.map((_, n): Vec3 => [Math.floor(n / high) * edge, 0, (n % high) * edge]);
  return { size: [wide * edge, edge, high * edge], origins };
}
