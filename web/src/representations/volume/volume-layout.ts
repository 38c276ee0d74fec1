// Lays out the parts of a volume content in shared textures, before anything is allocated for them.
import { count, kMacroblock, kTexturesOfShader } from '../../raymarch/content';
import { layOutAtlas, stack, type AtlasLayout } from '../../raymarch/content-layout';
import type { TextureLimits } from '../../tiles/content-limits';
import type { Vec3 } from '../../tiles/tileset';
import { kDistanceCell, type VolumePart } from './volume-content';

export interface VolumeLayout {
  planes: Vec3; // width, height, layers
  voxels: AtlasLayout;
  macroblocks: { size: Vec3; origins: Vec3[] };
  distances: { size: Vec3; origins: Vec3[] };
  bytes: number; // of all textures
}

const kOthers = 5; // texture units: planes (2), macroblocks, distances, opaque depth
const kMaxAtlases = Math.min(4, Math.floor((kTexturesOfShader - kOthers) / 2)); // each is split into two textures

// Returns undefined if the limits do not allow a layout.
export function layOut(parts: VolumePart[], limits: TextureLimits): VolumeLayout | undefined {
  const widest = Math.max(...parts.map((part) => part.planes));
  const voxels = layOutAtlas(parts.reduce((sum, part) => sum + part.stored, 0), limits.edge3D, kMaxAtlases);
  const macroblocks = stack(parts.map((part) => part.voxels / kMacroblock), limits.edge3D);
  const distances = stack(parts.map((part) => part.planes / kDistanceCell), limits.edge3D);
  if (!voxels || !macroblocks || !distances || 3 * parts.length > limits.layers || widest > limits.edge2D) return undefined;
  const planes: Vec3 = [widest, widest, 3 * parts.length];
  const bytes = 8 * (count(planes) + count(voxels.size)) + 4 * count(macroblocks.size) + count(distances.size);
  return { planes, voxels, macroblocks, distances, bytes };
}
