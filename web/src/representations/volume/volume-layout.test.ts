import { describe, expect, it } from 'vitest';
import { texturesOf } from '../../raymarch/content-layout';
import { kPromisedLimits } from '../../tiles/content-limits';
import type { VolumePart } from './volume-content';
import { layOut } from './volume-layout';

function partWith(stored: number): VolumePart {
  return {
    centre: [0, 0, 0], scale: [1, 1, 1], low: [-1, -1, -1], high: [1, 1, 1], contracted: false, surround: false,
    voxels: 512, planes: 1024, stored,
  };
}

describe('the layout of a content', () => {
  it('has one texture for its voxels where they fit into one', () => {
    const { voxels } = layOut([partWith(28 ** 3)], kPromisedLimits)!;
    expect(voxels.blocks).toEqual([28, 28, 28]);
    expect(texturesOf(voxels)).toBe(1);
    expect(voxels.depth).toBeLessThanOrEqual(kPromisedLimits.edge3D);
  });

  it('has several, one above the other, where the card takes no larger one', () => {
    const { voxels } = layOut([partWith(28 ** 3), partWith(1)], kPromisedLimits)!;
    expect(voxels.blocks).toEqual([28, 28, 29]);
    expect(texturesOf(voxels)).toBe(2);
    expect(texturesOf(layOut([partWith(4 * 28 ** 3)], kPromisedLimits)!.voxels)).toBe(4);
  });

  it('is none where a shader could not look into all of them', () => {
    expect(layOut([partWith(4 * 28 ** 3 + 1)], kPromisedLimits)).toBeUndefined();
    expect(layOut([partWith(1), { ...partWith(1), planes: 4096 }], kPromisedLimits)).toBeUndefined();
  });
});
