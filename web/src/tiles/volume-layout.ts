// How a content's parts share textures, before anything is allocated for them.
import type { Vec3 } from './tileset';
import { kDistanceCell, kMacroblock, kStoredEdge, type VolumePart } from './volume-content';

export interface TextureLimits {
  edge2D: number; // texels along an edge of a layer; WebGL2 promises 2048
  edge3D: number; // texels along an edge of a texture of three dimensions; WebGL2 promises 256
  layers: number; // of an array; 256
  uniformBytes: number; // of a block of uniforms; 16384
}

export const kPromisedLimits: TextureLimits = { edge2D: 2048, edge3D: 256, layers: 256, uniformBytes: 16384 };

export interface VolumeLayout {
  planes: Vec3; // width, height, layers
  voxels: Vec3; // texels of the atlas
  atlas: Vec3; // the same in macroblocks
  atlasDepth: number; // texels of it that one texture has, at most: it may be cut into several
  macroblocks: { size: Vec3; origins: Vec3[] };
  distances: { size: Vec3; origins: Vec3[] };
  bytes: number; // of all textures
}

const kMostAtlases = 4; // with two textures each, and five others, no more than the sixteen that a shader may have

// Undefined where the limits do not allow it.
export function layOut(parts: VolumePart[], limits: TextureLimits): VolumeLayout | undefined {
  const widest = Math.max(...parts.map((part) => part.planes));
  const stored = parts.reduce((sum, part) => sum + part.stored, 0);
  const most = Math.floor(limits.edge3D / kStoredEdge);
  const atlas = atlasOf(stored, most);
  const macroblocks = stack(parts.map((part) => part.voxels / kMacroblock), limits.edge3D);
  const distances = stack(parts.map((part) => part.planes / kDistanceCell), limits.edge3D);
  if (!atlas || !macroblocks || !distances || 3 * parts.length > limits.layers || widest > limits.edge2D) return undefined;
  const planes: Vec3 = [widest, widest, 3 * parts.length];
  const voxels: Vec3 = [kStoredEdge * atlas[0], kStoredEdge * atlas[1], kStoredEdge * atlas[2]];
  const count = (size: Vec3) => size[0] * size[1] * size[2];
  const bytes = 8 * (count(planes) + count(voxels)) + 4 * count(macroblocks.size) + count(distances.size);
  return { planes, voxels, atlas, atlasDepth: kStoredEdge * most, macroblocks, distances, bytes };
}

// Nearly a cube, with little left over; where that is too large, higher than wide. Places are bytes.
function atlasOf(stored: number, most: number): Vec3 | undefined {
  if (stored === 0) return [0, 0, 0];
  if (stored > most ** 3) {
    const high = Math.ceil(stored / most ** 2);
    return high <= Math.min(kMostAtlases * most, 256) ? [most, most, high] : undefined;
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
function stack(edges: number[], most: number): { size: Vec3; origins: Vec3[] } | undefined {
  const edge = Math.max(...edges);
  const high = Math.min(edges.length, Math.floor(most / edge));
  if (high < 1) return undefined;
  const wide = Math.ceil(edges.length / high);
  if (wide * edge > most) return undefined;
  const origins = edges.map((_, n): Vec3 => [Math.floor(n / high) * edge, 0, (n % high) * edge]);
  return { size: [wide * edge, edge, high * edge], origins };
}
