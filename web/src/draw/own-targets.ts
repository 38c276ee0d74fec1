// Draws into render targets of a drawer's own.
import * as THREE from 'three';
import { drawAsTheyStand, type Picture } from './picture';

// Calls `draw` with a renderer that clears only when told to, with 0 for all channels, and restores its state afterwards.
export function drawIntoTargets(renderer: THREE.WebGLRenderer, pictures: Pick<Picture, 'camera'>[], draw: () => void): void {
  const before = renderer.getRenderTarget();
  const { autoClear } = renderer;
  const clearColour = renderer.getClearColor(new THREE.Color());
  const clearAlpha = renderer.getClearAlpha();
  renderer.setClearColor(0, 0);
  renderer.autoClear = false;
  try {
    drawAsTheyStand(renderer, pictures, draw);
  } finally {
    renderer.autoClear = autoClear;
    renderer.setClearColor(clearColour, clearAlpha);
    renderer.setRenderTarget(before);
  }
}
