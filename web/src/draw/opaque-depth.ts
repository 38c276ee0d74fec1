// Renders the depth of the opaque objects of a world, where rays end, with their own materials, so that alpha tests and
// displacements count. The scene's own mesh is transparent and therefore not part of it.
import * as THREE from 'three';
import { drawAsTheyStand, type Picture } from './picture';

// Returns a depth texture of one texel, so that programs need no variant for worlds without opaque objects.
export function farthestDepth(): THREE.DataTexture {
  const texture = new THREE.DataTexture(new Uint8Array([255]), 1, 1, THREE.RedFormat);
  texture.needsUpdate = true;
  return texture;
}

export class OpaqueDepth {
  hasChanged = false; // whether anything in the world has moved, appeared or disappeared since the last call of `draw`
  private target?: THREE.WebGLRenderTarget;
  private lastPlaces: number[] = [];

  get bytes(): number {
    // Colour and depth take 4 bytes each.
    return this.target ? 8 * this.target.width * this.target.height : 0;
  }

  // Returns null if there is nothing opaque in the world that `scene` is in. `surfaces` are objects that are
  // transparent but end rays all the same, by the depth that they write.
  draw(
    renderer: THREE.WebGLRenderer, pictures: Pick<Picture, 'camera' | 'part'>[], scene: THREE.Object3D, size: THREE.Vector2,
    surfaces: ReadonlySet<THREE.Object3D> = new Set(),
  ): THREE.Texture | null {
    let world: THREE.Object3D = scene;
    while (world.parent) world = world.parent;
    const seeThrough = new Set<THREE.Material>();
    const layers = new THREE.Layers();
    layers.mask = pictures.reduce((mask, { camera }) => mask | camera.layers.mask, 0);
    const seen: THREE.Object3D[] = [];
    let hasOpaque = false;
    const look = (object: THREE.Object3D) => {
      if (!object.visible) return; // children are invisible too
      seen.push(object);
      const { material } = object as THREE.Mesh;
      if (material !== undefined && object.layers.test(layers)) {
        for (const one of Array.isArray(material) ? material : [material]) {
          if (!one.visible) continue;
          // Materials that are transparent or write no depth end no rays; other materials of the same object may.
          if (!surfaces.has(object) && (one.transparent || !one.depthWrite)) seeThrough.add(one);
          else hasOpaque = true;
        }
      }
      for (const child of object.children) look(child);
    };
    look(world);
    if (!hasOpaque) {
      this.hasChanged = this.target !== undefined;
      this.dispose();
      return null;
    }
    const target = (this.target ??= this.make());
    if (target.width !== size.x || target.height !== size.y) target.setSize(size.x, size.y);
    for (const material of seeThrough) material.visible = false;
    const background = (world as THREE.Scene).background;
    if (background) (world as THREE.Scene).background = null;
    const before = renderer.getRenderTarget();
    const { autoClear } = renderer;
    const { autoUpdate, needsUpdate } = renderer.shadowMap;
    renderer.shadowMap.autoUpdate = renderer.shadowMap.needsUpdate = false;
    renderer.setRenderTarget(target);
    renderer.clear();
    renderer.autoClear = false;
    drawAsTheyStand(renderer, pictures, () => {
      for (const { camera, part } of pictures) {
        target.viewport.copy(part);
        renderer.setRenderTarget(target);
        renderer.render(world, camera);
      }
    });
    renderer.autoClear = autoClear;
    renderer.setRenderTarget(before);
    Object.assign(renderer.shadowMap, { autoUpdate, needsUpdate });
    if (background) (world as THREE.Scene).background = background;
    for (const material of seeThrough) material.visible = true;
    // Joints of animated models are objects, too. Rendering has updated the matrices.
    const places = seen.flatMap(({ id, matrixWorld: { elements } }) => [id, ...elements]);
    this.hasChanged = places.length !== this.lastPlaces.length || places.some((x, i) => x !== this.lastPlaces[i]);
    this.lastPlaces = places;
    return target.depthTexture;
  }

  dispose(): void {
    this.target?.depthTexture?.dispose();
    this.target?.dispose();
    this.target = undefined;
  }

  private make(): THREE.WebGLRenderTarget {
    const depthTexture = new THREE.DepthTexture(1, 1, THREE.UnsignedIntType);
    depthTexture.minFilter = depthTexture.magFilter = THREE.NearestFilter;
    return new THREE.WebGLRenderTarget(1, 1, { depthTexture, depthBuffer: true, generateMipmaps: false });
  }
}
