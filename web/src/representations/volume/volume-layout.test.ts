import { describe, expect, it } from 'vitest';
import { countTextures } from '../../raymarch/content-layout';
import { kDeclaredLimits } from '../../tiles/content-limits';
import type { VolumePart } from './volume-content';
import { layOut } from './volume-layout';

function partWith(stored: number): VolumePart {
  return {
    centre: [0, 0, 0], scale: [1, 1, 1], low: [-1, -1, -1], high: [1, 1, 1], contracted: false, backgroundBlock: false,
    voxels: 512, planes: 1024, stored,
  };
}

describe('the layout of a content', () => {
  it('uses one texture for the voxels if they fit', () => {
    const { voxels } = layOut([partWith(28 ** 3)], kDeclaredLimits)!;
    expect(voxels.blocks).toEqual([28, 28, 28]);
    expect(countTextures(voxels)).toBe(1);
    expect(voxels.depth).toBeLessThanOrEqual(kDeclaredLimits.edge3D);
  });

  it('uses several stacked textures if the GPU supports no larger one', () => {
    const { voxels } = layOut([partWith(28 ** 3), partWith(1)], kDeclaredLimits)!;
    expect(voxels.blocks).toEqual([28, 28, 29]);
    expect(countTextures(voxels)).toBe(2);
    expect(countTextures(layOut([partWith(4 * 28 ** 3)], kDeclaredLimits)!.voxels)).toBe(4);
  });

  it('fails if a shader could not bind all of them', () => {
    expect(layOut([partWith(4 * 28 ** 3 + 1)], kDeclaredLimits)).toBeUndefined();
    expect(layOut([partWith(1), { ...partWith(1), planes: 4096 }], kDeclaredLimits)).toBeUndefined();
  });
});
