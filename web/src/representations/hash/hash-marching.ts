// The marching of `hash` scenes: contents accumulate sums, which the networks convert to colours after all contents
// have been drawn.
import * as THREE from 'three';
import type { Picture } from '../../draw/picture';
import type { SceneDrawing } from '../../draw/scene-drawer';
import { Compositor, type MarchedDrawnContent } from '../../raymarch/compositor';
import type { ProgramPieces, ViewUniforms } from '../../raymarch/content-program';
import type { ContentTarget, TargetForm } from '../../draw/content-target';
import type { ContentTextures } from '../../raymarch/content-textures';
import type { MarchedOwn, Marching, MarchMethod } from '../../raymarch/marching';
import type { HashHeader } from './decode-hash';
import { kMaxTables, vectorsOfHash, type HashContent } from './hash-content';
import { kHashModes } from './hash-modes';
import { hashPieces, countNetworks } from './hash-program';
import { HashTextures } from './hash-textures';
import { NetworkPass, type DrawnNetwork, type NetworkOrder } from './network-pass';

const kSums = 4; // attachments of the render target

export interface HashOwn extends MarchedOwn {
  uniforms: { network: { value: number } }; // index of the content's network in the picture (hash-program.ts)
  network: DrawnNetwork;
}

const kMethod: MarchMethod<HashHeader, HashContent, HashOwn> = {
  modes: kHashModes,
  target: (levels): TargetForm => ({
    representation: 'hash', pictures: kSums, morePictures: Math.max(Math.ceil(levels / countNetworks(0)) - 1, 0), holdsSums: true,
  }),
  make: (target, screen, view) => new HashMarching(target, screen, view),
};

export const hashDrawing = {
  modes: kHashModes,
  featureLevels: { label: 'Hash level', maximum: kMaxTables, coarse: 'The coarse features' },
  makeDrawer: (renderer, scene) => new Compositor(renderer, scene, kMethod),
} satisfies SceneDrawing<HashHeader, HashContent, MarchedDrawnContent<HashOwn>>;

class HashMarching implements Marching<HashHeader, HashContent, HashOwn> {
  readonly uniforms = {
    shares: { value: new Array<number>(kMaxTables + 1).fill(1) }, // shown share of the colours of the coarse features and of each level
    attention: { value: 0 }, // selects a level whose weights are shown instead (shaders/representations/hash/hash_march.glsl)
  };
  featureLevels = 0;
  readonly lastPass: NetworkPass;
  private readonly weightTargets: number; // number of weight targets besides the first

  constructor({ target, morePictures }: ContentTarget, screen: THREE.BufferGeometry, view: ViewUniforms) {
    this.weightTargets = morePictures;
    this.lastPass = new NetworkPass(target, screen, view, morePictures);
  }

  vectors(header: HashHeader): number {
    return vectorsOfHash(header);
  }

  pieces(content: HashHeader | HashContent): ProgramPieces {
    return hashPieces(content, this.weightTargets);
  }

  textures(content: HashContent): ContentTextures {
    return new HashTextures(content);
  }

  prepare(header: HashHeader): THREE.Mesh[] {
    this.featureLevels = Math.max(this.featureLevels, header.parts[0].tables.length);
    return [this.lastPass.getDrawnNetwork(header.network).mesh];
  }

  own(content: HashContent): HashOwn {
    const network = this.lastPass.getDrawnNetwork(content.network);
    ++network.contents;
    return { uniforms: { network: { value: 0 } }, meshes: [network.mesh], hasLearnedBackground: content.settings.hasLearnedBackground, network };
  }

  release({ network }: HashOwn): void {
    this.lastPass.release(network);
  }

  // `level` is the feature level that the mode shows, if it shows one; 0 for the coarse features.
  show(mode: string, level: number): void {
    const { shares, attention } = this.uniforms;
    shares.value.forEach((_, l) => (shares.value[l] = mode === 'contribution' && l !== level ? 0 : 1));
    const fine = Math.max(level, 1); // the coarse features have no weights
    attention.value = mode === 'attention' ? 2 * fine : mode === 'densityAttention' ? 2 * fine - 1 : 0;
  }

  begin(frontToBack: HashOwn[], backgroundContent?: HashOwn): (renderer: THREE.WebGLRenderer, picture: Picture) => void {
    const order = this.assignNetworks(frontToBack, backgroundContent);
    return (renderer, picture) => this.lastPass.draw(renderer, picture, order);
  }

  // Assigns an index in the picture to each network. Networks beyond the number that can be distinguished share the
  // last index.
  private assignNetworks(frontToBack: HashOwn[], backgroundContent?: HashOwn): NetworkOrder {
    const distinctNetworks = new Set([...(backgroundContent ? [backgroundContent] : []), ...frontToBack].map(({ network }) => network));
    const networks = [...distinctNetworks].slice(0, countNetworks(this.weightTargets));
    const networkIndex = ({ network }: HashOwn) => (networks.includes(network) ? networks.indexOf(network) : networks.length - 1);
    for (const own of frontToBack) own.uniforms.network.value = networkIndex(own);
    return { networks, hasLearnedBackground: backgroundContent !== undefined, behind: backgroundContent ? networkIndex(backgroundContent) : 0 };
  }
}
