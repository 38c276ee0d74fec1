// What contents are drawn into, front to back: as fine as the card can blend it, and as many pictures as it takes at once.
import * as THREE from 'three';
import { SceneError } from '../scene-error';

// What a representation's contents write.
export interface TargetForm {
  representation: string; // which errors name
  pictures: number; // 0: what the scene adds, with opacity; 1: how far its surface is; and its own
  morePictures: number; // as many more as the card takes, at most
  holdsSums: boolean; // not colours but sums of which these are made: they are not mixed between pixels, and do not fit into bytes
}

export interface ContentTarget {
  target: THREE.WebGLRenderTarget;
  distancesOfBytes: boolean; // from 0 for no distance to 255 for the farthest
  morePictures: number; // that there are
  bytesPerPixel: number; // of all pictures, without depth
}

interface Storage {
  type: THREE.TextureDataType;
  floatDistances: boolean;
  morePictures: number;
}

function targetOf({ pictures, holdsSums }: TargetForm, { type, floatDistances, morePictures }: Storage): ContentTarget {
  const count = pictures + morePictures;
  const filter = holdsSums ? THREE.NearestFilter : THREE.LinearFilter;
  const target = new THREE.WebGLRenderTarget(1, 1, {
    generateMipmaps: false, depthBuffer: true, depthTexture: new THREE.DepthTexture(1, 1, THREE.UnsignedIntType), count, type,
    minFilter: filter, magFilter: filter,
  });
  const distances = target.textures[1];
  distances.minFilter = distances.magFilter = THREE.NearestFilter;
  if (floatDistances) distances.type = THREE.FloatType;
  const isBytes = type === THREE.UnsignedByteType;
  return { target, distancesOfBytes: isBytes, morePictures, bytesPerPixel: (isBytes ? 4 : 8) * count + (floatDistances ? 8 : 0) };
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
export function contentTarget(renderer: THREE.WebGLRenderer, form: TargetForm): ContentTarget {
  const { representation, pictures, holdsSums } = form;
  const has = (name: string) => renderer.extensions.has(name);
  const canBlendHalves = has('EXT_color_buffer_half_float') || has('EXT_color_buffer_float');
  const remedy = 'draw it on another machine';
  if (holdsSums && !canBlendHalves) {
    throw new SceneError('graphics card', '', `cannot blend half floats, which scenes of ${representation} need`, remedy);
  }
  const gl = renderer.getContext() as WebGL2RenderingContext;
  const most = Math.min(gl.getParameter(gl.MAX_DRAW_BUFFERS) as number, gl.getParameter(gl.MAX_COLOR_ATTACHMENTS) as number);
  const type = canBlendHalves ? THREE.HalfFloatType : THREE.UnsignedByteType;
  // Half floats tell distances apart by a two-thousandth: places that are measured want more.
  const canBlendFloats = has('EXT_color_buffer_float') && has('EXT_float_blend');
  // Some cards take fewer bits of a pixel than pictures.
  for (let morePictures = Math.min(form.morePictures, most - pictures); morePictures >= 0; --morePictures) {
    for (const floatDistances of canBlendFloats ? [true, false] : [false]) {
      const made = targetOf(form, { type, floatDistances, morePictures });
      if (isComplete(renderer, made.target)) return made;
      made.target.depthTexture!.dispose();
      made.target.dispose();
    }
  }
  throw new SceneError('graphics card', '', `cannot draw into the pictures that scenes of ${representation} need`, remedy);
}
