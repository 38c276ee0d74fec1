// The textures of a `mesh` content on the GPU.
import * as THREE from 'three';
import { kForms, SlicedTextures } from '../../draw/sliced-textures';
import { textureSize, type MeshContent } from './mesh-content';

export interface PartTextures {
  features: THREE.Texture;
  opacity: THREE.Texture;
}

export class MeshTextures extends SlicedTextures {
  readonly parts: PartTextures[];
  readonly sky?: THREE.DataTexture;

  constructor({ isCompressed, parts, texels, skyEdge, sky }: MeshContent) {
    super();
    this.parts = texels.map(({ features, opacity }, n) => {
      const size = textureSize(parts[n]);
      if (parts[n].patches === 0) return { features: new THREE.Texture(), opacity: new THREE.Texture() };
      if (!isCompressed) {
        return {
          features: this.add(new THREE.DataArrayTexture(null, ...size, features.length), kForms.fourBytes, features, true),
          opacity: this.add(new THREE.DataArrayTexture(null, ...size, 1), kForms.oneByte, opacity, true),
        };
      }
      const blocks = (layers: number) => {
        const image = { data: null as unknown as Uint8Array<ArrayBuffer>, width: size[0], height: size[1] };
        return new THREE.CompressedArrayTexture([image], ...size, layers, THREE.RED_RGTC1_Format);
      };
      return {
        features: this.add(blocks(features.length), kForms.bc5, features, true),
        opacity: this.add(blocks(1), kForms.bc4, opacity, true),
      };
    });
    if (skyEdge === 0) return;
    this.sky = new THREE.DataTexture(sky, skyEdge, 6 * skyEdge);
    this.sky.minFilter = this.sky.magFilter = THREE.LinearFilter;
    this.sky.needsUpdate = true;
  }

  override dispose(): void {
    super.dispose();
    this.sky?.dispose();
  }
}
