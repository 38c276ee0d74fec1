// The interface of a representation to the compositor, for contents that are drawn by ray marching.
import type * as THREE from 'three';
import type { ContentTarget, TargetForm } from '../draw/content-target';
import type { ShownMode } from '../draw/display-modes';
import type { Picture } from '../draw/picture';
import type { MarchedContent, MarchedHeader } from './content';
import type { ProgramPieces, ViewUniforms } from './content-program';
import type { ContentTextures } from './content-textures';

// What a content on the GPU has besides its textures.
export interface MarchedOwn {
  uniforms: Record<string, THREE.IUniform>; // of its program
  meshes: THREE.Mesh<THREE.BufferGeometry, THREE.Material>[]; // meshes whose programs must also be compiled before the content is drawn
  hasLearnedBackground: boolean; // rays that hit nothing are opaque
}

export const kNothingOwn: MarchedOwn = { uniforms: {}, meshes: [], hasLearnedBackground: false };

// A final pass that converts the sums of all contents to colours.
export interface LastPass {
  readonly target: THREE.WebGLRenderTarget; // receives the colours
  readonly bytesPerPixel: number;
  resize(width: number, height: number): void;
  dispose(): void;
}

// The marching of one scene.
export interface Marching<Header extends MarchedHeader, Decoded extends MarchedContent, Own extends MarchedOwn> {
  readonly uniforms: Record<string, THREE.IUniform>; // of all contents' programs, besides those of the view
  readonly featureLevels: number; // see SceneDrawer.featureLevels
  readonly lastPass?: LastPass; // if undefined, contents write colours
  vectors(content: Header): number; // number of vec4s in the uniform block of its program
  pieces(content: Header | Decoded, isDrawnForLong: boolean): ProgramPieces;
  textures(content: Decoded): ContentTextures;
  // Like SceneDrawer.prepare; the driver also starts to compile the programs of the returned meshes.
  prepare?(header: Header): THREE.Mesh[];
  own(content: Decoded): Own;
  release?(own: Own): void; // called when a content leaves the GPU
  show?(mode: string, featureLevel: number): void;
  // Called for each picture before its contents are drawn, with the contents front to back; the returned function is
  // called afterwards. `backgroundContent` is the content that rays which hit nothing belong to, if such rays are
  // opaque.
  begin?(frontToBack: Own[], backgroundContent?: Own): (renderer: THREE.WebGLRenderer, picture: Picture) => void;
}

export interface MarchMethod<Header extends MarchedHeader, Decoded extends MarchedContent, Own extends MarchedOwn> {
  modes: readonly ShownMode[];
  target(levels: number): TargetForm;
  // `screen` is a triangle that fills the screen.
  make(target: ContentTarget, screen: THREE.BufferGeometry, view: ViewUniforms): Marching<Header, Decoded, Own>;
}
