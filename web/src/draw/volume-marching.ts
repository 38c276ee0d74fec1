// How contents of a `volume` scene are marched through: each writes its own colours.
import type { VolumeHeader } from '../tiles/decode-volume';
import { vectorsOfVolume, type VolumeContent } from '../tiles/volume-content';
import { Compositor, type MarchedDrawnContent } from './compositor';
import { kSharedModes } from './display-modes';
import { kNothingOwn, type MarchedOwn, type MarchMethod } from './marching';
import type { SceneDrawing } from './scene-drawer';
import { volumePieces } from './volume-program';
import { VolumeTextures } from './volume-textures';

const kMethod: MarchMethod<VolumeHeader, VolumeContent, MarchedOwn> = {
  modes: kSharedModes,
  target: () => ({ representation: 'volume', pictures: 2, morePictures: 0, holdsSums: false }),
  make: () => ({
    uniforms: {},
    featureLevels: 0,
    vectors: vectorsOfVolume,
    pieces: volumePieces,
    textures: (content) => new VolumeTextures(content),
    own: () => kNothingOwn,
  }),
};

export const volumeDrawing = {
  modes: kSharedModes,
  makeDrawer: (renderer, scene) => new Compositor(renderer, scene, kMethod),
} satisfies SceneDrawing<VolumeHeader, VolumeContent, MarchedDrawnContent>;
