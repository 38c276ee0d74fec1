// The marching of `volume` scenes: each content writes colours directly.
import { kSharedModes } from '../../draw/display-modes';
import type { SceneDrawing } from '../../draw/scene-drawer';
import { Compositor, type MarchedDrawnContent } from '../../raymarch/compositor';
import { kNothingOwn, type MarchedOwn, type MarchMethod } from '../../raymarch/marching';
import type { VolumeHeader } from './decode-volume';
import { vectorsOfVolume, type VolumeContent } from './volume-content';
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
