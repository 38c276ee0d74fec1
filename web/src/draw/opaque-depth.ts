// The depth of what is opaque in a world, the scene apart: rays end there.
import * as THREE from 'three';

export class OpaqueDepth {
  private target?: THREE.WebGLRenderTarget;

  get bytes(): number {
    // Colour and depth, 4 bytes each.
    return this.target ? 8 * this.target.width * this.target.height : 0;
  }

  // Null where there is nothing opaque. `scene` and what it holds is left out; the world is what it stands in.
  draw(renderer: THREE.WebGLRenderer, camera: THREE.Camera, scene: THREE.Object3D, size: THREE.Vector2): THREE.Texture | null {
    let world: THREE.Object3D = scene;
    while (world.parent) world = world.parent;
    const hidden: THREE.Object3D[] = [];
    let found = false;
    const look = (object: THREE.Object3D) => {
      if (object === scene || !object.visible) return;
      const drawable = object as THREE.Mesh;
      if (drawable.material !== undefined && object.layers.test(camera.layers)) {
        const materials = Array.isArray(drawable.material) ? drawable.material : [drawable.material];
        // What lets light through, or writes no depth, ends no ray.
        if (materials.every((material) => !material.transparent && material.depthWrite && material.visible)) found = true;
        else hidden.push(object);
      }
      for (const child of object.children) look(child);
    };
    if (world !== scene) look(world);
    if (!found) {
      this.dispose();
      return null;
    }
    this.target ??= this.make();
    if (this.target.width !== size.x || this.target.height !== size.y) this.target.setSize(size.x, size.y);
    const wasVisible = scene.visible;
    scene.visible = false;
    const masks = hidden.map((object) => object.layers.mask); // not `visible`: children may be opaque
    for (const object of hidden) object.layers.disableAll();
    const background = (world as THREE.Scene).background;
    if (background) (world as THREE.Scene).background = null;
    const before = renderer.getRenderTarget();
    const { autoUpdate, needsUpdate } = renderer.shadowMap;
    renderer.shadowMap.autoUpdate = renderer.shadowMap.needsUpdate = false;
    renderer.setRenderTarget(this.target);
    renderer.clear();
    renderer.render(world, camera);
    renderer.setRenderTarget(before);
    Object.assign(renderer.shadowMap, { autoUpdate, needsUpdate });
    if (background) (world as THREE.Scene).background = background;
    hidden.forEach((object, i) => (object.layers.mask = masks[i]));
    scene.visible = wasVisible;
    return this.target.depthTexture;
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
