// The render target that contents are drawn into, front to back: the most precise formats that the GPU can blend, and
// as many attachments as it supports.
import * as THREE from 'three';
import { SceneError } from '../scene-error';

// The attachments that a representation's contents write.
export interface TargetForm {
  representation: string; // named in errors
  pictures: number; // attachment 0: premultiplied colour with opacity; 1: distance of the surface; then the representation's own
  morePictures: number; // maximum number of additional attachments, if the GPU supports them
  // Holds sums from which colours are computed later: they must not be filtered between pixels and do not fit into
  // bytes.
  holdsSums: boolean;
}

export interface ContentTarget {
  target: THREE.WebGLRenderTarget;
  distancesOfBytes: boolean; // distances are stored as bytes, from 0 for distance 0 to 255 for infinity
  morePictures: number; // number of additional attachments
  bytesPerPixel: number; // of all attachments, without depth
}

interface Storage {
  type: THREE.TextureDataType;
  floatDistances: boolean;
  morePictures: number;
}

function makeTarget({ pictures, holdsSums }: TargetForm, { type, floatDistances, morePictures }: Storage): ContentTarget {
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

export function isComplete(renderer: THREE.WebGLRenderer, target: THREE.WebGLRenderTarget): boolean {
  const gl = renderer.getContext();
  const before = renderer.getRenderTarget();
  renderer.setRenderTarget(target);
  const complete = gl.checkFramebufferStatus(gl.FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
  renderer.setRenderTarget(before);
  return complete;
}

// Throws SceneError if the GPU cannot draw such a scene.
export function contentTarget(renderer: THREE.WebGLRenderer, form: TargetForm): ContentTarget {
  const { representation, pictures, holdsSums } = form;
  const has = (name: string) => renderer.extensions.has(name);
  const canBlendHalves = has('EXT_color_buffer_half_float') || has('EXT_color_buffer_float');
  const remedy = 'draw it on another machine';
  if (holdsSums && !canBlendHalves) {
    throw new SceneError('GPU', '', `cannot blend half floats, which scenes of ${representation} need`, remedy);
  }
  const gl = renderer.getContext() as WebGL2RenderingContext;
  const maximum = Math.min(gl.getParameter(gl.MAX_DRAW_BUFFERS) as number, gl.getParameter(gl.MAX_COLOR_ATTACHMENTS) as number);
  const type = canBlendHalves ? THREE.HalfFloatType : THREE.UnsignedByteType;
  // Half floats resolve distances to 1/2000, which is too coarse for measurements.
  const canBlendFloats = has('EXT_color_buffer_float') && has('EXT_float_blend');
  // Some GPUs limit the bits per pixel more strictly than the number of attachments.
  for (let morePictures = Math.min(form.morePictures, maximum - pictures); morePictures >= 0; --morePictures) {
    for (const floatDistances of canBlendFloats ? [true, false] : [false]) {
      const candidate = makeTarget(form, { type, floatDistances, morePictures });
      if (isComplete(renderer, candidate.target)) return candidate;
      candidate.target.depthTexture!.dispose();
      candidate.target.dispose();
    }
  }
  throw cannotRender(representation);
}

export function cannotRender(representation: string): SceneError {
  return new SceneError('GPU', '', `cannot render into the images that scenes of ${representation} need`, 'draw it on another machine');
}
