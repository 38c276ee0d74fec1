// Boxes in which nothing of a scene is drawn.
import type * as THREE from 'three';
import { SceneError } from '../scene-error';

export const kMaxHiddenBoxes = 8; // boxes set by the user, and as many again in the background block alone

// Returns the boxes that hide something (DrawSettings): `all` of the background block, of which the first
// `ofAllContents` also hide the other contents. Throws SceneError if there are too many.
export function selectHiddenBoxes(
  boxes: readonly THREE.Matrix4[], ofBackgroundBlock: readonly THREE.Matrix4[],
): { all: THREE.Matrix4[]; ofAllContents: number } {
  if (boxes.length > kMaxHiddenBoxes) {
    throw new SceneError('scene', 'hidden', `contains ${boxes.length} boxes; at most ${kMaxHiddenBoxes} are supported`, 'hide fewer, larger ones');
  }
  const whole = (box: THREE.Matrix4) => box.determinant() !== 0;
  const ofAll = boxes.filter(whole);
  return { all: [...ofAll, ...ofBackgroundBlock.filter(whole).slice(0, kMaxHiddenBoxes)], ofAllContents: ofAll.length };
}
