// The rules for volume contents: docs/tile-format.md, section 6. Each function returns the first violation as text for
// users.
import { ruleOfMacroblocks, ruleOfPlace } from '../../raymarch/content-rules';
import type { Broken } from '../../tiles/tileset-rules';
import type { VolumePart } from './volume-content';

export const kMaxVoxels = 1024; // along an axis
export const kMaxPlanes = 4096;
export const kMaxStepsPerTexel = 8;
const kLargestRange = 100;
export const kVolumeInputs = 34; // of the network

export function ruleOfRange(range: number): Broken {
  return range > 0 && range <= kLargestRange ? undefined : 'a range is out of bounds';
}

export function ruleOfPart(part: VolumePart): Broken {
  if (part.voxels % 8 !== 0 || part.voxels < 1) return 'its number of voxels is out of bounds';
  if (part.planes % 8 !== 0 || part.planes < 1) return 'its number of plane texels is out of bounds';
  return ruleOfMacroblocks(part, part.voxels) ?? ruleOfPlace(part);
}
