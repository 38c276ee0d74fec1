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

// Returns numbers that change with the depth of an object. NaN, which equals nothing, stands for what cannot be known:
// shaders of the user may move vertices. `isSurface`: the object is a scene of ours, whose depth others look after.
function describeObject(object: THREE.Object3D, isSurface: boolean): number[] {
  const { id, matrixWorld: { elements } } = object;
  const state = [id, ...elements];
  if (isSurface) return state;
  const mesh = object as THREE.SkinnedMesh & Partial<Pick<THREE.InstancedMesh, 'instanceMatrix' | 'count'>>;
  state.push(...(mesh.morphTargetInfluences ?? []), mesh.instanceMatrix?.version ?? 0, mesh.count ?? 0);
  for (const bone of mesh.skeleton?.bones ?? []) state.push(...bone.matrixWorld.elements);
  for (const { version } of Object.values(mesh.geometry?.attributes ?? {}) as THREE.BufferAttribute[]) state.push(version ?? 0);
  for (const material of [mesh.material].flat()) {
    const { version, visible, transparent, depthWrite, alphaTest } = material;
    state.push(material.id, version, Number(visible), Number(transparent), Number(depthWrite), alphaTest);
    if (material instanceof THREE.ShaderMaterial) state.push(NaN);
  }
  return state;
}

export class OpaqueDepth {
  hasChanged = false; // whether the depth may be another one than that of the last call of `draw` for the same cameras
  hidesBehindScene = false; // whether the world has anything that is drawn after the scene, and that its surface may hide
  private target?: THREE.WebGLRenderTarget;
  private lastState: number[] = [];

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
    const ends = new Set<THREE.Object3D>(); // objects that end rays
    this.hidesBehindScene = false;
    const look = (object: THREE.Object3D) => {
      if (!object.visible) return; // children are invisible too
      const { material } = object as THREE.Mesh;
      if (material !== undefined && object.layers.test(layers)) {
        for (const one of Array.isArray(material) ? material : [material]) {
          if (!one.visible) continue;
          // Materials that are transparent or write no depth end no rays; other materials of the same object may.
          if (!surfaces.has(object) && (one.transparent || !one.depthWrite)) seeThrough.add(one);
          else ends.add(object);
          if (object.parent !== scene && one.transparent && one.depthTest) this.hidesBehindScene = true;
        }
      }
      for (const child of object.children) look(child);
    };
    look(world);
    if (ends.size === 0) {
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
    const state = [...ends].flatMap((object) => describeObject(object, surfaces.has(object))); // rendering has updated the matrices
    this.hasChanged = state.length !== this.lastState.length || state.some((x, i) => x !== this.lastState[i]);
    this.lastState = state;
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
