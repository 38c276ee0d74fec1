// What contents are drawn into, front to back: as fine as the card can blend it, and as many pictures as it takes at once.
import * as THREE from 'three';
import { SceneError } from '../scene-error';
import type { Tileset } from '../tiles/tileset';
import { networksOf } from './hash-program';

const kPicturesOfVolume = 2;
const kSumsOfHash = 4;

export interface ContentTarget {
  // 0: what the scene adds, or sums of which that is made, with opacity; 1: how far its surface is; of `hash` further sums.
  target: THREE.WebGLRenderTarget;
  distancesOfBytes: boolean; // from 0 for no distance to 255 for the farthest
  weightTargets: number; // of `hash`: of weights, beyond the first
  bytesPerPixel: number; // of all pictures, without depth
}

interface Form {
  type: THREE.TextureDataType;
  floatDistances: boolean;
  weightTargets: number;
}

function targetOf(representation: Tileset['representation'], { type, floatDistances, weightTargets }: Form): ContentTarget {
  const isHash = representation === 'hash';
  const count = isHash ? kSumsOfHash + weightTargets : kPicturesOfVolume;
  const filter = isHash ? THREE.NearestFilter : THREE.LinearFilter;
  const target = new THREE.WebGLRenderTarget(1, 1, {
    generateMipmaps: false, depthBuffer: true, depthTexture: new THREE.DepthTexture(1, 1, THREE.UnsignedIntType), count, type,
    minFilter: filter, magFilter: filter,
  });
  const distances = target.textures[1];
  distances.minFilter = distances.magFilter = THREE.NearestFilter;
  if (floatDistances) distances.type = THREE.FloatType;
  const isBytes = type === THREE.UnsignedByteType;
  return { target, distancesOfBytes: isBytes, weightTargets, bytesPerPixel: (isBytes ? 4 : 8) * count + (floatDistances ? 8 : 0) };
}

function isComplete(renderer: THREE.WebGLRenderer, target: THREE.WebGLRenderTarget): boolean {
  const gl = renderer.getContext();
  const before = renderer.getRenderTarget();
  renderer.setRenderTarget(target);
  const complete = gl.checkFramebufferStatus(gl.FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
  renderer.setRenderTarget(before);
  return complete;
}

// Throws SceneError where the card cannot draw such a scene.
export function contentTarget(
  renderer: THREE.WebGLRenderer, { representation, levels }: Pick<Tileset, 'representation' | 'levels'>,
): ContentTarget {
  const has = (name: string) => renderer.extensions.has(name);
  const canBlendHalves = has('EXT_color_buffer_half_float') || has('EXT_color_buffer_float');
  const isHash = representation === 'hash';
  const remedy = 'draw it on another machine';
  if (isHash && !canBlendHalves) throw new SceneError('graphics card', '', 'cannot blend half floats, which scenes of hash need', remedy);
  const gl = renderer.getContext() as WebGL2RenderingContext;
  const most = Math.min(gl.getParameter(gl.MAX_DRAW_BUFFERS) as number, gl.getParameter(gl.MAX_COLOR_ATTACHMENTS) as number);
  const type = canBlendHalves ? THREE.HalfFloatType : THREE.UnsignedByteType;
  // Half floats tell distances apart by a two-thousandth: places that are measured want more.
  const canBlendFloats = has('EXT_color_buffer_float') && has('EXT_float_blend');
  const wanted = isHash ? Math.min(Math.max(Math.ceil(levels / networksOf(0)) - 1, 0), most - kSumsOfHash) : 0;
  // Some cards take fewer bits of a pixel than pictures.
  for (let weightTargets = wanted; weightTargets >= 0; --weightTargets) {
    for (const floatDistances of canBlendFloats ? [true, false] : [false]) {
      const made = targetOf(representation, { type, floatDistances, weightTargets });
      if (isComplete(renderer, made.target)) return made;
      made.target.depthTexture!.dispose();
      made.target.dispose();
    }
  }
  throw new SceneError('graphics card', '', `cannot draw into the pictures that scenes of ${representation} need`, remedy);
}
