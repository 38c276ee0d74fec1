// What of a representation the compositor asks for, to draw contents through which rays are marched.
import type * as THREE from 'three';
import type { ShownMode } from '../draw/display-modes';
import type { Picture } from '../draw/picture';
import type { MarchedContent, MarchedHeader } from './content';
import type { ProgramPieces, ViewUniforms } from './content-program';
import type { ContentTarget, TargetForm } from './content-target';
import type { ContentTextures } from './content-textures';

// What a content on the card has beside its textures.
export interface MarchedOwn {
  uniforms: Record<string, THREE.IUniform>; // of its program
  meshes: THREE.Mesh<THREE.BufferGeometry, THREE.Material>[]; // whose programs are to be there, too, before it is drawn
  whole: boolean; // rays that end nowhere are opaque
}

export const kNothingOwn: MarchedOwn = { uniforms: {}, meshes: [], whole: false };

// A last pass over a picture, which makes colours of what all contents together add up to.
export interface LastPass {
  readonly target: THREE.WebGLRenderTarget; // of colours
  readonly bytes: number; // of the card
  resize(width: number, height: number): void;
  dispose(): void;
}

// One for each scene.
export interface Marching<Header extends MarchedHeader, Decoded extends MarchedContent, Own extends MarchedOwn> {
  readonly uniforms: Record<string, THREE.IUniform>; // of all contents' programs, beside the view's
  readonly featureLevels: number; // as SceneDrawer has them
  readonly lastPass?: LastPass; // where there is none, contents write colours
  vectors(content: Header): number; // of four numbers, that its program is given
  pieces(content: Header | Decoded, isDrawnForLong: boolean): ProgramPieces;
  textures(content: Decoded): ContentTextures;
  // As SceneDrawer's; the driver is to begin with the programs of these, too.
  prepare?(header: Header): THREE.Mesh[];
  own(content: Decoded): Own;
  release?(own: Own): void; // of a content that leaves the card
  show?(mode: string, featureLevel: number): void;
  // Of each picture, before its contents are drawn, front to back, and when they have been. `ofNothing`: where rays that meet
  // nothing are opaque, the content that they belong to.
  begin?(frontToBack: Own[], ofNothing?: Own): (renderer: THREE.WebGLRenderer, picture: Picture) => void;
}

export interface MarchMethod<Header extends MarchedHeader, Decoded extends MarchedContent, Own extends MarchedOwn> {
  modes: readonly ShownMode[];
  target(levels: number): TargetForm;
  // `screen` is a triangle that fills the picture.
  make(target: ContentTarget, screen: THREE.BufferGeometry, view: ViewUniforms): Marching<Header, Decoded, Own>;
}
