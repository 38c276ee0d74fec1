// Handles that move, rotate and scale a model or a box. While they are dragged, the camera does not move.
import type * as THREE from 'three';
import type { TransformControls } from 'three/addons/controls/TransformControls.js';
import type { Viewer } from '../viewer';
import { kFarthest, scaledWithin, scaleWithin } from '../world/world-fields';

export const kGizmoModes = { translate: 'Move', rotate: 'Turn', scale: 'Scale' } as const;
export type GizmoMode = keyof typeof kGizmoModes;

export class ModelGizmo {
  onModeChange: () => void = () => {};
  private controls?: Promise<TransformControls>;
  private object?: THREE.Object3D;
  private current: GizmoMode = 'translate';
  private pressed = false; // the pointer was pressed on a handle

  // `isBox` scales each axis separately and only allows rotation about the vertical axis.
  constructor(private readonly viewer: Viewer, private readonly moved: () => void, private readonly isBox = false) {}

  get mode(): GizmoMode {
    return this.current;
  }

  set mode(mode: GizmoMode) {
    this.current = mode;
    void this.controls?.then((controls) => this.setMode(controls));
    this.onModeChange();
  }

  nextMode(): void {
    const modes = Object.keys(kGizmoModes) as GizmoMode[];
    this.mode = modes[(modes.indexOf(this.mode) + 1) % modes.length];
  }

  // Returns whether the current click was one on a handle.
  takesClick(): boolean {
    return this.pressed;
  }

  attach(object: THREE.Object3D | undefined): void {
    if (object === this.object) return;
    this.object = object;
    if (object) {
      this.controls ??= this.make();
      this.controls.catch(() => (this.controls = undefined)); // the next call tries again
    }
    void this.controls?.then((controls) => {
      if (this.object) controls.attach(this.object);
      else controls.detach();
      this.viewer.needPicture();
    }, () => {});
  }

  private setMode(controls: TransformControls): void {
    controls.mode = this.current;
    controls.showX = controls.showZ = !this.isBox || this.current !== 'rotate';
  }

  private async make(): Promise<TransformControls> {
    const { TransformControls } = await import('three/addons/controls/TransformControls.js');
    const { camera, canvas, navigation, world } = this.viewer;
    const controls = new TransformControls(camera, canvas);
    this.setMode(controls);
    controls.size = 0.8;
    controls.showE = controls.showXYZE = false;
    controls.setColors(0xe0675e, 0x6199ee, 0x83c46c, 0xffe08a); // as in a z-up world: the vertical axis is blue
    const helper = controls.getHelper();
    helper.userData.isTool = true;
    world.add(helper);
    controls.addEventListener('change', () => this.viewer.needPicture());
    controls.addEventListener('objectChange', () => {
      if (controls.mode === 'scale' && this.object) {
        if (this.isBox) this.object.scale.set(...absoluteScale(this.object));
        else scaleAlike(this.object, before);
      }
      this.object?.position.clampScalar(-kFarthest, kFarthest);
      this.viewer.resolution.moved(performance.now());
      this.moved();
    });
    let before = { x: 1, y: 1, z: 1 };
    controls.addEventListener('mouseDown', () => (before = this.object!.scale.clone()));
    // Handled before the navigation receives the event.
    canvas.addEventListener('pointerdown', (event) => {
      const { x, y } = this.viewer.pointerAt(event);
      controls.pointerHover({ x, y, button: event.button } as PointerEvent);
      this.pressed = controls.axis !== null && event.button === 0;
      if (this.pressed) navigation.enabled = false;
    }, { capture: true });
    for (const over of ['pointerup', 'pointercancel']) addEventListener(over, () => (navigation.enabled = true));
    return controls;
  }
}

// Returns the scale of a box, which must not be mirrored.
function absoluteScale({ scale }: THREE.Object3D): [number, number, number] {
  return scale.toArray().map((x) => scaleWithin(Math.max(Math.abs(x), 1e-3))) as [number, number, number];
}

// Scales all axes by the factor of the one that changed most.
function scaleAlike({ scale }: THREE.Object3D, before: { x: number; y: number; z: number }): void {
  const factors = (['x', 'y', 'z'] as const).map((axis) => Math.max(scale[axis] / before[axis], 0.01));
  const factor = factors.reduce((maximum, one) => (Math.abs(Math.log(one)) > Math.abs(Math.log(maximum)) ? one : maximum));
  scale.fromArray(scaledWithin([before.x, before.y, before.z], factor));
}
