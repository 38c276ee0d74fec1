// Shows the scene in a headset (WebXR): the user stands at the eye of the current view, at true scale, and moves with
// the controllers' thumbsticks.
import * as THREE from 'three';
import { SceneError } from '../../scene-error';
import { GroundFrame } from '../measuring/geodesy';
import type { Look } from '../moving/navigation';
import type { Mover, Viewer } from '../viewer';
import { Rig, type Head } from './rig';
import { computeGlide, computeRise, readStick, StepTurn } from './sticks';

// 18 ms lies between a missed frame of the slowest headsets, at 72 Hz, and a timely frame of a screen at 60 Hz.
const kPace = { target: 18, patience: 150, share: 0.5 };
const kWalk = 2; // metres per second, at least; higher up, the eye's height per second

export class Headset implements Mover {
  onChange: (isOn: boolean) => void = () => {};
  private rig?: Rig;
  private head?: Head; // undefined until the headset has a pose
  private start: Look; // the first view in the headset
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

  // Throws SceneError if the headset cannot be entered.
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
    this.rig.playSpace.add(this.viewer.camera);
    this.viewer.world.add(this.rig.playSpace);
    this.viewer.takeOver(this, kPace);
    this.onChange(true);
  }

  async leave(): Promise<void> {
    await this.viewer.renderer.xr.getSession()?.end();
  }

  get look(): Look {
    if (!this.rig || !this.head) return this.start;
    const eye = this.rig.eyePosition(this.head);
    const gaze = this.rig.gazeDirection(this.head);
    // The approximate intersection of the gaze with the ground, no farther away than the previous target.
    const maximum = this.start.eye.distanceTo(this.start.target);
    const toGround = gaze.y < 0 ? Math.max(this.eyeHeight(eye), this.viewer.navigation.orbit.minDistance) / -gaze.y : maximum;
    return { eye, target: eye.clone().addScaledVector(gaze, Math.min(toGround, maximum)) };
  }

  // The user stays upright at the eye, as the head itself looks up and down.
  set look({ eye, target }: Look) {
    this.start = { eye, target };
    this.head = undefined;
  }

  flyTo(look: Look): void {
    this.look = look;
  }

  // Returns true always: heads are never at rest, so every frame shows another view.
  update(seconds: number): boolean {
    const { xr } = this.viewer.renderer;
    const space = xr.getReferenceSpace();
    const pose = space && xr.getFrame()?.getViewerPose(space);
    if (!pose || !this.rig) return true;
    const isFirst = !this.head;
    const head = (this.head = pose.transform);
    if (isFirst) this.rig.place(head, this.start.eye, headingTo(this.start));
    const sources = xr.getSession()?.inputSources ?? [];
    const turn = this.turning.updateTurn(readStick(sources, 'right'));
    if (turn !== 0) this.rig.turn(head, turn);
    const { right, forward } = computeGlide(readStick(sources, 'left'));
    const way = new THREE.Vector3(right, computeRise(readStick(sources, 'right')), -forward);
    way.applyAxisAngle(THREE.Object3D.DEFAULT_UP, this.rig.computeHeading(head));
    const speed = Math.max(kWalk * this.unitsPerMetre, this.eyeHeight(this.rig.eyePosition(head)));
    this.rig.move(way.multiplyScalar(speed * Math.min(seconds, 0.1)));
    return true;
  }

  private async begin(): Promise<void> {
    const { renderer } = this.viewer;
    let session: XRSession | undefined;
    try {
      session = await navigator.xr!.requestSession('immersive-vr', { optionalFeatures: ['layers'] });
      if (this.viewer.isPaused) throw new Error('an image is being rendered');
      renderer.xr.enabled = true;
      await renderer.xr.setSession(session);
    } catch (error) {
      renderer.xr.enabled = false;
      await session?.end().catch(() => {});
      if (!this.viewer.isPaused) this.viewer.takeOver(); // restores what three.js has left half done
      const reason = `does not show the scene (${error instanceof Error ? error.message : String(error)})`;
      throw new SceneError('headset', '', reason, 'put it on, allow the page to use it, and try again');
    }
  }

  private left(): void {
    const { viewer, rig } = this;
    if (!rig) return;
    const { look } = this;
    rig.playSpace.removeFromParent();
    viewer.camera.removeFromParent();
    viewer.camera.scale.setScalar(1);
    viewer.renderer.xr.enabled = false;
    this.rig = this.head = undefined;
    viewer.takeOver();
    viewer.navigation.look = look;
    this.onChange(false);
  }

  // Returns the height above the lowest point of the captured region.
  private eyeHeight(eye: THREE.Vector3): number {
    return eye.y - this.viewer.city.bounds.min.y;
  }

  private get unitsPerMetre(): number {
    return new GroundFrame(this.viewer.city.tileset.georeference).unitsPerMetre;
  }
}

function headingTo({ eye, target }: Look): number {
  return Math.atan2(eye.x - target.x, eye.z - target.z);
}
