// The drawing of each representation, one per row.
import type { ShownMode } from '../draw/display-modes';
import type { SceneDrawing } from '../draw/scene-drawer';
import type { KnownRepresentation } from './codecs';
import { hashDrawing } from './hash/hash-marching';
import { meshDrawing } from './mesh/mesh-drawing';
import { volumeDrawing } from './volume/volume-marching';

const kDrawings = { volume: volumeDrawing, hash: hashDrawing, mesh: meshDrawing } satisfies Record<KnownRepresentation, SceneDrawing>;

export type DisplayMode = (typeof kDrawings)[KnownRepresentation]['modes'][number]['name'];

// The display modes of all representations, the shared ones first.
export const kDisplayModes: readonly DisplayMode[] = [
  ...new Set(Object.values(kDrawings).flatMap(({ modes }) => modes.map(({ name }) => name))),
];

export interface KnownDrawing extends SceneDrawing {
  modes: readonly ShownMode<DisplayMode>[];
}

export function getDrawing(representation: KnownRepresentation): KnownDrawing {
  return kDrawings[representation];
}
