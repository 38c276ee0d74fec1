// A headset that shows the scene (WebXR): one stands where the view's eye was, at true size, and the controllers' sticks move.
import * as THREE from 'three';
import { SceneError } from '../../scene-error';
import { GroundFrame } from '../measuring/geodesy';
import type { Look } from '../moving/navigation';
import type { Mover, Viewer } from '../viewer';
import { Rig, type Head } from './rig';
import { glideOf, riseOf, stickOf, StepTurn } from './sticks';

// 18 ms: between a picture missed by the slowest headsets, of 72 a second, and one shown in time by a screen of 60.
const kPace = { target: 18, patience: 150, share: 0.5 };
const kWalk = 2; // metres a second, at least; from above, as far as one is high in a second

export class Headset implements Mover {
  onChange: (isOn: boolean) => void = () => {};
  private rig?: Rig;
  private head?: Head; // since it is known where it is
  private start: Look; // what is to be seen first
  private readonly turning = new StepTurn();
  private isEntering = false;

  constructor(private readonly viewer: Viewer) {
    this.start = viewer.navigation.look;
    viewer.renderer.xr.setReferenceSpaceType('local');
    viewer.renderer.xr.addEventListener('sessionend', () => this.left());
  }

  get isOn(): boolean {
    return this.rig !== undefined;
  }

  // Throws SceneError.
  async enter(): Promise<void> {
    if (this.isOn || this.isEntering) return;
    this.isEntering = true;
    try {
      await this.begin();
    } finally {
      this.isEntering = false;
    }
    this.start = this.viewer.navigation.look;
    this.rig = new Rig(this.unitsPerMetre);
    this.rig.room.add(this.viewer.camera);
    this.viewer.world.add(this.rig.room);
    this.viewer.takeOver(this, kPace);
    this.onChange(true);
  }

  async leave(): Promise<void> {
    await this.viewer.renderer.xr.getSession()?.end();
  }

  get look(): Look {
    if (!this.rig || !this.head) return this.start;
    const eye = this.rig.eyeOf(this.head);
    const gaze = this.rig.gazeOf(this.head);
    // Where the gaze meets the ground, about; no farther than what was looked at before.
    const most = this.start.eye.distanceTo(this.start.target);
    const toGround = gaze.y < 0 ? Math.max(this.heightOf(eye), this.viewer.navigation.orbit.minDistance) / -gaze.y : most;
    return { eye, target: eye.clone().addScaledVector(gaze, Math.min(toGround, most)) };
  }

  // Upright, and where it is: the head looks up and down by itself.
  set look({ eye, target }: Look) {
    this.start = { eye, target };
    this.head = undefined;
  }

  flyTo(look: Look): void {
    this.look = look;
  }

  // Always true: each picture is of another place, as heads are never at rest.
  update(seconds: number): boolean {
    const { xr } = this.viewer.renderer;
    const space = xr.getReferenceSpace();
    const pose = space && xr.getFrame()?.getViewerPose(space);
    if (!pose || !this.rig) return true;
    const isFirst = !this.head;
    const head = (this.head = pose.transform);
    if (isFirst) this.rig.place(head, this.start.eye, headingTo(this.start));
    const sources = xr.getSession()?.inputSources ?? [];
    const turn = this.turning.turnOf(stickOf(sources, 'right'));
    if (turn !== 0) this.rig.turn(head, turn);
    const { right, forward } = glideOf(stickOf(sources, 'left'));
    const way = new THREE.Vector3(right, riseOf(stickOf(sources, 'right')), -forward);
    way.applyAxisAngle(THREE.Object3D.DEFAULT_UP, this.rig.headingOf(head));
    const speed = Math.max(kWalk * this.unitsPerMetre, this.heightOf(this.rig.eyeOf(head)));
    this.rig.move(way.multiplyScalar(speed * Math.min(seconds, 0.1)));
    return true;
  }

  private async begin(): Promise<void> {
    const { renderer } = this.viewer;
    let session: XRSession | undefined;
    try {
      session = await navigator.xr!.requestSession('immersive-vr', { optionalFeatures: ['layers'] });
      if (this.viewer.isHeld) throw new Error('a picture is being drawn');
      renderer.xr.enabled = true;
      await renderer.xr.setSession(session);
    } catch (error) {
      renderer.xr.enabled = false;
      await session?.end().catch(() => {});
      if (!this.viewer.isHeld) this.viewer.takeOver(); // of what three has left half done
      const reason = `does not show the scene (${error instanceof Error ? error.message : String(error)})`;
      throw new SceneError('headset', '', reason, 'put it on, allow the page to use it, and try again');
    }
  }

  private left(): void {
    const { viewer, rig } = this;
    if (!rig) return;
    const { look } = this;
    rig.room.removeFromParent();
    viewer.camera.removeFromParent();
    viewer.camera.scale.setScalar(1);
    viewer.renderer.xr.enabled = false;
    this.rig = this.head = undefined;
    viewer.takeOver();
    viewer.navigation.look = look;
    this.onChange(false);
  }

  // Above the lowest of what was captured.
  private heightOf(eye: THREE.Vector3): number {
    return eye.y - this.viewer.city.bounds.min.y;
  }

  private get unitsPerMetre(): number {
    return new GroundFrame(this.viewer.city.tileset.georeference).unitsPerMetre;
  }
}

function headingTo({ eye, target }: Look): number {
  return Math.atan2(eye.x - target.x, eye.z - target.z);
}
