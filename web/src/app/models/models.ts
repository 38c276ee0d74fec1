// The models in a world, and the selected one.
import * as THREE from 'three';
import { clone } from 'three/addons/utils/SkeletonUtils.js';
import type { LoadedModel } from './load-model';
import { fileExtension, baseName } from './model-files';
import { addLight } from './model-light';
import type { Viewer } from '../viewer';
import { kNameLength, scaleWithin } from '../world/world-fields';

// The loaded data that several models may be copies of.
export interface ModelSource extends LoadedModel {
  base: THREE.Vector3; // centre of its underside
  size: THREE.Vector3;
}

// A placed model, whose base is at its origin.
export class PlacedModel extends THREE.Group {
  plays = true;
  readonly mixer?: THREE.AnimationMixer;
  readonly isPlacedModel = true;

  constructor(readonly source: ModelSource, name: string) {
    super();
    this.name = name;
    const object = clone(source.object);
    this.add(new THREE.Group().add(object));
    this.children[0].position.copy(source.base).negate();
    if (source.clips.length === 0) return;
    this.mixer = new THREE.AnimationMixer(object);
    this.mixer.clipAction(source.clips[0]).play();
  }
}

export class Models {
  readonly list: PlacedModel[] = [];
  readonly onChange = new Set<() => void>(); // called when the list, the selection or a placement changes
  private chosen?: PlacedModel;
  private isChanging = false; // true within changeAll, which notifies at its end
  private isLit = false;

  constructor(private readonly viewer: Viewer) {
    viewer.onFrame.add(({ milliseconds }) => this.play(Math.min(milliseconds, 100) / 1000));
  }

  get selected(): PlacedModel | undefined {
    return this.chosen;
  }

  select(model: PlacedModel | undefined): void {
    if (model === this.chosen) return;
    this.chosen = model;
    this.changed();
  }

  // Runs `change` and notifies once of everything that it did.
  changeAll(change: () => void): void {
    this.isChanging = true;
    try {
      change();
    } finally {
      this.isChanging = false;
      this.changed();
    }
  }

  changed(): void {
    if (this.isChanging) return;
    this.viewer.needPicture();
    for (const tell of this.onChange) tell();
  }

  static makeSource(loaded: LoadedModel): ModelSource {
    const base = loaded.box.getCenter(new THREE.Vector3());
    base.y = loaded.box.min.y;
    return { ...loaded, base, size: loaded.box.getSize(new THREE.Vector3()) };
  }

  // Adds a model at the world's origin, in its own size.
  add(source: ModelSource, name = this.freeName(baseName(source.files[0].path).slice(0, -1 - fileExtension(source.files[0].path).length))): PlacedModel {
    if (!this.isLit) addLight(this.viewer.world, this.viewer.renderer);
    this.isLit = true;
    const model = new PlacedModel(source, name);
    model.scale.setScalar(this.ownScale(source));
    this.list.push(model);
    this.viewer.world.add(model);
    this.changed();
    return model;
  }

  // Adds a copy on the right-hand side of the model as seen by the camera.
  duplicate(model: PlacedModel): PlacedModel {
    const copy = this.add(model.source, this.freeName(model.name));
    copy.position.copy(model.position);
    copy.quaternion.copy(model.quaternion);
    copy.scale.copy(model.scale);
    const right = new THREE.Vector3().setFromMatrixColumn(this.viewer.camera.matrixWorld, 0).setY(0).normalize();
    copy.position.addScaledVector(right, this.modelWidth(model));
    this.select(copy);
    return copy;
  }

  remove(model: PlacedModel): void {
    this.list.splice(this.list.indexOf(model), 1);
    model.removeFromParent();
    model.mixer?.stopAllAction();
    model.traverse((one) => (one as THREE.SkinnedMesh).skeleton?.dispose());
    if (!this.list.some(({ source }) => source === model.source)) dispose(model.source.object);
    if (model === this.chosen) this.chosen = undefined;
    this.changed();
  }

  // Returns the horizontal diagonal with a margin, in world units.
  modelWidth({ source: { size }, scale }: PlacedModel): number {
    return 1.15 * Math.hypot(size.x * scale.x, size.z * scale.z);
  }

  // Returns the model under the pointer if nothing of the city is in front of it.
  at(event: { clientX: number; clientY: number }): PlacedModel | undefined {
    const at = this.viewer.pointerAt(event);
    const raycaster = new THREE.Raycaster();
    raycaster.setFromCamera(at, this.viewer.camera);
    const [hit] = raycaster.intersectObjects(this.list.filter(({ visible }) => visible));
    if (!hit) return undefined;
    const place = this.viewer.pickScenes(at);
    if (place && place.distanceTo(this.viewer.eye) < 0.98 * hit.distance) return undefined;
    let object: THREE.Object3D | null = hit.object;
    while (object && !(object as PlacedModel).isPlacedModel) object = object.parent;
    return object as PlacedModel;
  }

  // Returns the world units per metre. If the scene's scale is unknown, a model that would be much smaller than the
  // scene, or larger than it, is scaled to a tenth of the scene's size.
  private ownScale({ size }: ModelSource): number {
    const { tileset, bounds } = this.viewer.city;
    if (tileset.georeference) return scaleWithin(1 / Math.hypot(...tileset.georeference.enuFromWorld.slice(0, 3)));
    const share = size.length() / bounds.getSize(new THREE.Vector3()).length();
    return share > 1 || share < 1 / 2000 ? scaleWithin(0.1 / share) : 1;
  }

  // Returns a name that no other model has.
  freeName(given: string): string {
    const name = given.slice(0, kNameLength - 10) || 'Model';
    const plain = name.replace(/ \d+$/, '');
    const names = new Set(this.list.map((model) => model.name));
    let free = names.has(name) ? '' : name;
    for (let i = 2; free === ''; ++i) if (!names.has(`${plain} ${i}`)) free = `${plain} ${i}`;
    return free;
  }

  private play(seconds: number): void {
    const playing = this.list.filter(({ visible, plays, mixer }) => visible && plays && mixer);
    if (playing.length === 0) return;
    for (const { mixer } of playing) mixer!.update(seconds);
    this.viewer.resolution.played(performance.now());
    this.viewer.needPicture();
  }
}

function dispose(object: THREE.Object3D): void {
  object.traverse((one) => {
    const { geometry, material } = one as THREE.Mesh;
    geometry?.dispose();
    for (const each of material ? [material].flat() : []) {
      for (const value of Object.values(each)) if (value instanceof THREE.Texture) value.dispose();
      each.dispose();
    }
  });
}
