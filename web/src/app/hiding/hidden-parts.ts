// Boxes in which nothing of the scenes is drawn, and the selected box.
import * as THREE from 'three';
import { kYUpFromZUp, kZUpFromYUp } from '../../axes';
import { kMaxHiddenBoxes } from '../../draw/hidden-boxes';
import { scaleWithin } from '../world/world-fields';
import type { HiddenPart } from '../world/world-file';
import type { Viewer } from '../viewer';

// A cube of edge 1 about its origin, which is scaled, and rotated about the vertical axis only. Its edges are visible
// while it is selected.
export class HiddenBox extends THREE.Object3D {
  hides = true;
  private readonly edges: THREE.LineSegments;

  constructor(name: string) {
    super();
    this.name = name;
    const material = new THREE.LineBasicMaterial({ color: 0x6fc2d0, transparent: true, depthTest: false });
    this.edges = new THREE.LineSegments(new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1)), material);
    this.edges.raycast = () => {};
    this.userData.isTool = true;
    this.add(this.edges);
    this.showsEdges = false;
  }

  set showsEdges(shows: boolean) {
    this.edges.visible = shows;
  }

  // The centre in the capture's world, z up.
  get part(): HiddenPart {
    const middle = this.position.clone().applyMatrix4(kZUpFromYUp).toArray();
    const { x, y, z } = this.scale;
    return { name: this.name, middle, size: [x, z, y], turn: this.turn, hides: this.hides };
  }

  set part({ name, middle, size: [across, along, up], turn, hides }: HiddenPart) {
    this.name = name;
    this.position.fromArray(middle).applyMatrix4(kYUpFromZUp);
    this.scale.set(across, up, along);
    this.turn = turn;
    this.hides = hides;
  }

  // Radians, anticlockwise as seen from above.
  get turn(): number {
    return new THREE.Euler().setFromQuaternion(this.quaternion, 'YXZ').y;
  }

  set turn(turn: number) {
    this.rotation.set(0, turn, 0, 'YXZ');
  }

  override dispose(): void {
    super.dispose();
    this.edges.geometry.dispose();
    (this.edges.material as THREE.Material).dispose();
  }
}

export class HiddenParts {
  readonly list: HiddenBox[] = [];
  readonly onChange = new Set<() => void>(); // called when the list, the selection or a box changes
  private chosen?: HiddenBox;

  constructor(private readonly viewer: Viewer) {
    viewer.onScenes.add(() => this.apply());
  }

  get isFull(): boolean {
    return this.list.length >= kMaxHiddenBoxes;
  }

  get selected(): HiddenBox | undefined {
    return this.chosen;
  }

  select(box: HiddenBox | undefined): void {
    if (box === this.chosen) return;
    if (this.chosen) this.chosen.showsEdges = false;
    this.chosen = box;
    if (box) box.showsEdges = true;
    this.changed();
  }

  // Adds a box at a place in the world, with 1/20 of the extent of the visible world.
  addAt(place: THREE.Vector3): HiddenBox {
    const size = this.viewer.city.bounds.getSize(new THREE.Vector3());
    const box = this.add(new HiddenBox(this.freeName()));
    box.position.copy(place);
    box.scale.setScalar(scaleWithin(0.05 * Math.hypot(size.x, size.z)));
    this.select(box);
    return box;
  }

  // Replaces all boxes.
  show(parts: readonly HiddenPart[]): void {
    for (const box of [...this.list]) this.remove(box);
    for (const part of parts) this.add(new HiddenBox(part.name)).part = part;
    this.changed();
  }

  remove(box: HiddenBox): void {
    this.list.splice(this.list.indexOf(box), 1);
    box.removeFromParent();
    box.dispose();
    if (box === this.chosen) this.chosen = undefined;
    this.changed();
  }

  changed(): void {
    this.apply();
    this.viewer.needPicture();
    for (const tell of this.onChange) tell();
  }

  private add(box: HiddenBox): HiddenBox {
    this.list.push(box);
    this.viewer.world.add(box);
    return box;
  }

  private apply(): void {
    const boxes = this.list.filter(({ hides }) => hides);
    for (const box of boxes) box.updateMatrixWorld();
    for (const scene of this.viewer.scenes) {
      scene.updateWorldMatrix(true, false);
      const sceneFromWorld = scene.matrixWorld.clone().invert();
      scene.hidden = boxes.map(({ matrixWorld }) => sceneFromWorld.clone().multiply(matrixWorld));
    }
  }

  private freeName(): string {
    const names = new Set(this.list.map(({ name }) => name));
    for (let i = 1; ; ++i) if (!names.has(`Part ${i}`)) return `Part ${i}`;
  }
}
