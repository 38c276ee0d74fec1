// Boxes in which nothing of a scene is drawn.
import type * as THREE from 'three';
import { SceneError } from '../scene-error';

export const kMaxHiddenBoxes = 8; // boxes set by the user, and as many again in the background block alone

// Those in which nothing of the background block is drawn; of the first ones nothing of the other contents either.
export interface HiddenBoxes {
  all: THREE.Matrix4[];
  ofAllContents: number;
}

// Returns the boxes that hide something (DrawSettings). Throws SceneError if there are too many.
export function selectHiddenBoxes(boxes: readonly THREE.Matrix4[], ofBackgroundBlock: readonly THREE.Matrix4[]): HiddenBoxes {
  if (boxes.length > kMaxHiddenBoxes) {
    throw new SceneError('scene', 'hidden', `contains ${boxes.length} boxes; at most ${kMaxHiddenBoxes} are supported`, 'hide fewer, larger ones');
  }
  const whole = (box: THREE.Matrix4) => box.determinant() !== 0;
  const ofAll = boxes.filter(whole);
  return { all: [...ofAll, ...ofBackgroundBlock.filter(whole).slice(0, kMaxHiddenBoxes)], ofAllContents: ofAll.length };
}
