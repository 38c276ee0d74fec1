// The textures of a `volume` content on the GPU.
import * as THREE from 'three';
import { kForms } from '../../draw/sliced-textures';
import { atlasUniforms, ContentTextures } from '../../raymarch/content-textures';
import { packNetwork } from '../../tiles/network';
import type { Vec3 } from '../../tiles/tileset';
import { kVectorsOfPart, type VolumeContent, type VolumePart } from './volume-content';

export const kVoxelAtlases = ['voxelAtlasFirst', 'voxelAtlasSecond'] as const;

export class VolumeTextures extends ContentTextures<VolumePart> {
  readonly numbers: Float32Array;
  private readonly ofMarch: Record<string, THREE.IUniform>;
  private readonly origins: { macroblocks: Vec3[]; distances: Vec3[] };

  constructor(content: VolumeContent) {
    super(content.parts);
    const { planes, voxels, atlasDepth, macroblocks, distances } = content;
    this.origins = { macroblocks: macroblocks.origins, distances: distances.origins };
    this.ofMarch = {
      planeTexelsFirst: { value: this.add(new THREE.DataArrayTexture(null, ...planes.size), kForms.fourBytes, planes.first, true) },
      planeTexelsSecond: { value: this.add(new THREE.DataArrayTexture(null, ...planes.size), kForms.fourBytes, planes.second, true) },
      ...this.addAtlas(voxels, atlasDepth, kVoxelAtlases),
      ...atlasUniforms(voxels.size, atlasDepth),
      macroblocks: { value: this.addCubes(macroblocks, kForms.fourBytes) },
      distances: { value: this.addCubes(distances, kForms.oneByte) },
      featureRange: { value: content.featureRange },
      densityRange: { value: content.densityRange },
      stepsPerTexel: { value: content.stepsPerTexel },
    };
    const network = packNetwork(content.network);
    const ofParts = 4 * kVectorsOfPart * this.parts.length;
    this.numbers = new Float32Array(ofParts + network.length);
    this.numbers.set(network, ofParts);
    this.orderParts(this.parts.map((_, n) => n));
  }

  uniforms(): Record<string, THREE.IUniform> {
    return this.ofMarch;
  }

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
}
