// How contents of a `hash` scene are marched through: they add up to sums, of which the networks make colours when all
// are there.
import * as THREE from 'three';
import type { Picture } from '../../draw/picture';
import type { SceneDrawing } from '../../draw/scene-drawer';
import { Compositor, type MarchedDrawnContent } from '../../raymarch/compositor';
import type { ProgramPieces, ViewUniforms } from '../../raymarch/content-program';
import type { ContentTarget, TargetForm } from '../../raymarch/content-target';
import type { ContentTextures } from '../../raymarch/content-textures';
import type { MarchedOwn, Marching, MarchMethod } from '../../raymarch/marching';
import type { HashHeader } from './decode-hash';
import { kMostTables, vectorsOfHash, type HashContent } from './hash-content';
import { kHashModes } from './hash-modes';
import { hashPieces, networksOf } from './hash-program';
import { HashTextures } from './hash-textures';
import { NetworkPass, type DrawnNetwork, type NetworkOrder } from './network-pass';

const kSums = 4; // pictures

export interface HashOwn extends MarchedOwn {
  uniforms: { network: { value: number } }; // the network's number in the picture (hash-program.ts)
  network: DrawnNetwork;
}

const kMethod: MarchMethod<HashHeader, HashContent, HashOwn> = {
  modes: kHashModes,
  target: (levels): TargetForm => ({
    representation: 'hash', pictures: kSums, morePictures: Math.max(Math.ceil(levels / networksOf(0)) - 1, 0), holdsSums: true,
  }),
  make: (target, screen, view) => new HashMarching(target, screen, view),
};

export const hashDrawing = {
  modes: kHashModes,
  featureLevels: { label: 'Hash level', most: kMostTables, coarse: 'The coarse features' },
  makeDrawer: (renderer, scene) => new Compositor(renderer, scene, kMethod),
} satisfies SceneDrawing<HashHeader, HashContent, MarchedDrawnContent<HashOwn>>;

class HashMarching implements Marching<HashHeader, HashContent, HashOwn> {
  readonly uniforms = {
    shares: { value: new Array<number>(kMostTables + 1).fill(1) }, // of the coarse features and of each level, what is shown of their colours
    attention: { value: 0 }, // whose weights are shown instead, as shaders/representations/hash/hash_march.glsl has it
  };
  featureLevels = 0;
  readonly lastPass: NetworkPass;
  private readonly weightTargets: number; // beyond the first

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
    return [this.lastPass.networkOf(header.network).mesh];
  }

  own(content: HashContent): HashOwn {
    const network = this.lastPass.networkOf(content.network);
    ++network.contents;
    return { uniforms: { network: { value: 0 } }, meshes: [network.mesh], whole: content.settings.whole, network };
  }

  release({ network }: HashOwn): void {
    this.lastPass.release(network);
  }

  // `level` of features, 0 the coarse ones, where the mode shows one.
  show(mode: string, level: number): void {
    const { shares, attention } = this.uniforms;
    shares.value.forEach((_, l) => (shares.value[l] = mode === 'contribution' && l !== level ? 0 : 1));
    const fine = Math.max(level, 1); // nothing weighs the coarse ones
    attention.value = mode === 'attention' ? 2 * fine : mode === 'densityAttention' ? 2 * fine - 1 : 0;
  }

  begin(frontToBack: HashOwn[], ofNothing?: HashOwn): (renderer: THREE.WebGLRenderer, picture: Picture) => void {
    const order = this.networksOf(frontToBack, ofNothing);
    return (renderer, picture) => this.lastPass.draw(renderer, picture, order);
  }

  // Which number each network has in a picture. More than can be told apart are taken for the last.
  private networksOf(frontToBack: HashOwn[], ofNothing?: HashOwn): NetworkOrder {
    const found = new Set([...(ofNothing ? [ofNothing] : []), ...frontToBack].map(({ network }) => network));
    const networks = [...found].slice(0, networksOf(this.weightTargets));
    const numberOf = ({ network }: HashOwn) => (networks.includes(network) ? networks.indexOf(network) : networks.length - 1);
    for (const own of frontToBack) own.uniforms.network.value = numberOf(own);
    return { networks, whole: ofNothing !== undefined, behind: ofNothing ? numberOf(ofNothing) : 0 };
  }
}
