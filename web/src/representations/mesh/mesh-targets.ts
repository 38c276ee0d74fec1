// The images of a `mesh` scene on their way to the screen.
import * as THREE from 'three';
import { cannotRender, contentTarget, isComplete, type ContentTarget } from '../../draw/content-target';

export class MeshTargets {
  readonly output: ContentTarget; // colours and distances, for the page
  readonly solid: THREE.WebGLRenderTarget; // numbers of parts with bits of distances
  readonly dithered: THREE.WebGLRenderTarget; // what is visible: raster-program.ts
  readonly decoded: THREE.WebGLRenderTarget; // colours
  readonly history: THREE.WebGLRenderTarget;

  // Throws SceneError if the GPU cannot render into such images.
  constructor(renderer: THREE.WebGLRenderer) {
    this.output = contentTarget(renderer, { representation: 'mesh', pictures: 2, morePictures: 0, holdsSums: false });
    // One depth serves all: the passes that write `output` need none, and those that write `decoded` use it otherwise.
    const { depthTexture } = this.output.target;
    const nearest = { minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter, generateMipmaps: false } as const;
    this.solid = new THREE.WebGLRenderTarget(1, 1, { ...nearest, depthTexture });
    this.dithered = new THREE.WebGLRenderTarget(1, 1, { ...nearest, depthTexture });
    Object.assign(this.solid.texture, { format: THREE.RGIntegerFormat, type: THREE.UnsignedIntType, internalFormat: 'RG32UI' });
    Object.assign(this.dithered.texture, { format: THREE.RGBAIntegerFormat, type: THREE.UnsignedIntType, internalFormat: 'RGBA32UI' });
    this.decoded = new THREE.WebGLRenderTarget(1, 1, { ...nearest, depthTexture });
    this.history = new THREE.WebGLRenderTarget(1, 1, { ...nearest, depthBuffer: false, type: this.output.target.texture.type });
    if (this.all.every((target) => isComplete(renderer, target))) return;
    this.dispose();
    throw cannotRender('mesh');
  }

  get bytesPerPixel(): number {
    // Of solid, dithered and decoded, of the history, and of the depth.
    return 8 + 16 + 4 + (this.output.distancesOfBytes ? 4 : 8) + 4 + this.output.bytesPerPixel;
  }

  get bytes(): number {
    return this.decoded.width * this.decoded.height * this.bytesPerPixel;
  }

  private get all(): THREE.WebGLRenderTarget[] {
    return [this.output.target, this.solid, this.dithered, this.decoded, this.history];
  }

  // Returns false if the size is already this one.
  resize(width: number, height: number): boolean {
    if (this.decoded.width === width && this.decoded.height === height) return false;
    for (const target of this.all) target.setSize(width, height);
    return true;
  }

  // Sets all of `solid` or `dithered` to 0.
  clear(renderer: THREE.WebGLRenderer, target: THREE.WebGLRenderTarget): void {
    const gl = renderer.getContext() as WebGL2RenderingContext;
    renderer.setRenderTarget(target);
    renderer.state.buffers.color.setMask(true);
    gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]);
  }

  // Returns the distance of the solid surface in a pixel, if there is one.
  readSolidDistance(renderer: THREE.WebGLRenderer, [x, y]: [number, number]): number | undefined {
    const gl = renderer.getContext() as WebGL2RenderingContext;
    const before = renderer.getRenderTarget();
    const read = new Uint32Array(4); // part, and bits of the distance
    renderer.setRenderTarget(this.solid);
    gl.readPixels(x, y, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, read);
    renderer.setRenderTarget(before);
    return read[0] === 0 ? undefined : new Float32Array(read.buffer)[1];
  }

  dispose(): void {
    this.output.target.depthTexture?.dispose();
    for (const target of this.all) target.dispose();
  }
}
