// Navigation: over a map, around a place, or flying; with mouse, touch, keyboard or gamepad. Lengths are in metres, y
// up.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { padMotion, type Motion } from './gamepad';
import { isTyping } from '../page/shortcuts';
import { TwoFingers } from './two-fingers';

export const kModes = ['map', 'orbit', 'fly'] as const;
export type NavigationMode = (typeof kModes)[number];

export interface Look {
  eye: THREE.Vector3;
  target: THREE.Vector3;
}

const kFlight = 500; // ms of a flight to another view
const kMapAngle = 0.495 * Math.PI; // largest angle from straight down in map mode
const kFingerSpeed = 0.01; // seconds of flight per pixel
const kLookSpeed = 0.0025; // radians per pixel
const kTurnSpeed = 1.6; // radians per second, with a gamepad

type Pick = (event: { clientX: number; clientY: number }) => THREE.Vector3 | undefined;

export class Navigation {
  readonly orbit: OrbitControls;
  onModeChange: (mode: NavigationMode) => void = () => {};
  isPointing = false; // a tool handles clicks: double clicks do not navigate, and the pointer is not locked
  private current: NavigationMode = 'map';
  private readonly keys = new Set<string>();
  private flight?: { from: Look; to: Look; begin: number };
  private moved = false;
  private speed: number; // metres per second in fly mode
  private isSuspended = false; // while a tool drags something
  private looking?: number; // id of the pointer that turns the view in fly mode

  constructor(
    readonly camera: THREE.PerspectiveCamera,
    private readonly canvas: HTMLCanvasElement,
    private box: THREE.Box3,
    private readonly pick: Pick,
  ) {
    this.orbit = new OrbitControls(camera, canvas);
    this.orbit.enableDamping = true;
    this.orbit.zoomToCursor = true;
    this.orbit.addEventListener('change', () => (this.moved = true));
    this.orbit.addEventListener('start', () => (this.flight = undefined));
    this.bounds = box;
    this.speed = this.radius / 8;
    this.listen();
    this.mode = 'map';
  }

  // Adapts distances and clip planes to the box of the visible world.
  set bounds(box: THREE.Box3) {
    this.box = box;
    this.orbit.maxDistance = 6 * this.radius;
    this.orbit.minDistance = this.radius / 400;
    this.camera.near = this.radius / 1e4;
    this.camera.far = this.radius * 100;
    this.camera.updateProjectionMatrix();
  }

  // Enables moving the camera by dragging; tools disable it while they drag something.
  set enabled(enabled: boolean) {
    this.isSuspended = !enabled;
    this.orbit.enabled = enabled && this.current !== 'fly';
  }

  get mode(): NavigationMode {
    return this.current;
  }

  set mode(mode: NavigationMode) {
    if (this.current === 'fly' && mode !== 'fly') {
      if (document.pointerLockElement === this.canvas) document.exitPointerLock();
      // Orbits around the previous target, at its previous distance.
      const ahead = this.camera.getWorldDirection(new THREE.Vector3());
      const distance = Math.min(this.camera.position.distanceTo(this.orbit.target), this.radius);
      this.orbit.target.copy(this.camera.position).addScaledVector(ahead, Math.max(distance, this.orbit.minDistance));
    }
    this.current = mode;
    const isMap = mode === 'map';
    this.orbit.enabled = mode !== 'fly' && !this.isSuspended;
    this.orbit.screenSpacePanning = !isMap;
    this.orbit.maxPolarAngle = isMap ? kMapAngle : Math.PI;
    const { PAN, ROTATE, DOLLY } = THREE.MOUSE;
    this.orbit.mouseButtons = isMap ? { LEFT: PAN, MIDDLE: DOLLY, RIGHT: ROTATE } : { LEFT: ROTATE, MIDDLE: DOLLY, RIGHT: PAN };
    this.orbit.touches = isMap
      ? { ONE: THREE.TOUCH.PAN, TWO: THREE.TOUCH.DOLLY_ROTATE }
      : { ONE: THREE.TOUCH.ROTATE, TWO: THREE.TOUCH.DOLLY_PAN };
    this.onModeChange(mode);
  }

  get look(): Look {
    return { eye: this.camera.position.clone(), target: this.orbit.target.clone() };
  }

  // Sets the view immediately. If it looks upwards in map mode, the mode changes to orbit.
  set look({ eye, target }: Look) {
    this.flight = undefined;
    this.stopInertia();
    this.leaveMapFor({ eye, target });
    this.camera.position.copy(eye);
    this.orbit.target.copy(target);
    this.camera.lookAt(target);
    this.orbit.update();
    this.moved = true;
  }

  flyTo(to: Look): void {
    this.stopInertia();
    this.leaveMapFor(to);
    this.flight = { from: this.look, to: { eye: to.eye.clone(), target: to.target.clone() }, begin: performance.now() };
  }

  // OrbitControls goes on after a drag, and would do so after a flight.
  private stopInertia(): void {
    const { eye, target } = this.look;
    this.orbit.enableDamping = false;
    this.orbit.update();
    this.orbit.enableDamping = true;
    this.camera.position.copy(eye);
    this.orbit.target.copy(target);
  }

  private leaveMapFor({ eye, target }: Look): void {
    const up = eye.clone().sub(target).normalize().y;
    if (this.current === 'map' && up < Math.cos(kMapAngle)) this.mode = 'orbit';
  }

  // Shows the whole scene from above and from the side.
  showAll(): void {
    this.look = this.overview();
  }

  flyHome(): void {
    this.flyTo(this.overview());
  }

  // Flies closer to a place, in the current viewing direction.
  focus(place: THREE.Vector3): void {
    const away = this.camera.position.clone().sub(place).multiplyScalar(0.4);
    away.setLength(Math.max(away.length(), 2 * this.orbit.minDistance));
    this.flyTo({ eye: place.clone().add(away), target: place });
  }

  // Is called once a frame. Returns true if the camera has moved.
  update(seconds: number): boolean {
    this.flyOn();
    if (!this.isSuspended) {
      this.move(this.keyMotion(), seconds);
      this.move(padMotion(), seconds);
    }
    if (this.orbit.enabled && !this.flight) this.orbit.update();
    const moved = this.moved;
    this.moved = false;
    return moved;
  }

  private get radius(): number {
    const size = this.box.getSize(new THREE.Vector3());
    return 0.5 * Math.hypot(size.x, size.z);
  }

  private overview(): Look {
    const target = this.box.getCenter(new THREE.Vector3());
    target.y = this.box.min.y;
    const away = this.radius * Math.max(1, 1 / this.camera.aspect);
    return { eye: new THREE.Vector3(0, 0.75, 0.8).multiplyScalar(away).add(target), target };
  }

  private flyOn(): void {
    if (!this.flight) return;
    const { from, to, begin } = this.flight;
    const passed = Math.min((performance.now() - begin) / kFlight, 1);
    const smooth = passed * passed * (3 - 2 * passed);
    // At its end the view is `to`, wherever the flight began.
    this.camera.position.copy(to.eye);
    this.orbit.target.copy(to.target);
    if (passed < 1) {
      this.camera.position.lerpVectors(from.eye, to.eye, smooth);
      this.orbit.target.lerpVectors(from.target, to.target, smooth);
    }
    this.camera.lookAt(this.orbit.target);
    this.moved = true;
    if (passed === 1) this.flight = undefined;
  }

  private keyMotion(): Motion {
    const pressed = (...codes: string[]) => (codes.some((code) => this.keys.has(code)) ? 1 : 0);
    return {
      right: pressed('KeyD', 'ArrowRight') - pressed('KeyA', 'ArrowLeft'),
      up: pressed('KeyE', 'PageUp') - pressed('KeyQ', 'PageDown'),
      forward: pressed('KeyW', 'ArrowUp') - pressed('KeyS', 'ArrowDown'),
      yaw: 0, pitch: 0, fast: pressed('ShiftLeft', 'ShiftRight') === 1,
    };
  }

  private move({ right, up, forward, yaw, pitch, fast }: Motion, seconds: number): void {
    if (right === 0 && up === 0 && forward === 0 && yaw === 0 && pitch === 0) return;
    const time = (fast ? 4 : 1) * Math.min(seconds, 0.1);
    this.go(right * time, up * time, forward * time);
    this.turn(yaw * kTurnSpeed * seconds, pitch * kTurnSpeed * seconds);
  }

  // Moves for `seconds` at the given shares of full speed.
  private go(right: number, up: number, forward: number): void {
    this.flight = undefined;
    const ahead = this.camera.getWorldDirection(new THREE.Vector3());
    const side = new THREE.Vector3().crossVectors(ahead, this.camera.up).normalize();
    if (this.current !== 'fly') ahead.crossVectors(this.camera.up, side).normalize(); // horizontally, over the ground
    const speed = this.current === 'fly' ? this.speed : 0.8 * this.camera.position.distanceTo(this.orbit.target);
    const way = ahead.multiplyScalar(forward).addScaledVector(side, right).addScaledVector(this.camera.up, up);
    way.multiplyScalar(speed);
    this.camera.position.add(way);
    this.orbit.target.add(way);
    this.moved = true;
  }

  // Turns the camera in place, by radians to the left and upwards.
  private turn(yaw: number, pitch: number): void {
    if (yaw === 0 && pitch === 0) return;
    const euler = new THREE.Euler().setFromQuaternion(this.camera.quaternion, 'YXZ');
    euler.y += yaw;
    euler.x = Math.min(Math.max(euler.x + pitch, -1.55), 1.55);
    euler.z = 0;
    this.camera.quaternion.setFromEuler(euler);
    const distance = this.camera.position.distanceTo(this.orbit.target);
    this.orbit.target.copy(this.camera.position).addScaledVector(this.camera.getWorldDirection(new THREE.Vector3()), distance);
    this.moved = true;
  }

  private listen(): void {
    addEventListener('keydown', ({ code, target, ctrlKey, metaKey, altKey }) => {
      // Sliders handle the arrow keys themselves.
      if (ctrlKey || metaKey || altKey || isTyping(target) || target instanceof HTMLInputElement) return;
      this.keys.add(code);
    });
    addEventListener('keyup', ({ code }) => {
      this.keys.delete(code);
      if (code.startsWith('Meta')) this.keys.clear(); // macOS does not tell of keys that were released meanwhile
    });
    addEventListener('blur', () => this.keys.clear());
    this.canvas.addEventListener('dblclick', (event) => {
      if (this.isPointing) return;
      const place = this.pick(event);
      if (place && this.current !== 'fly') this.focus(place);
    });
    this.canvas.addEventListener('pointerdown', ({ pointerId, pointerType }) => {
      if (this.current !== 'fly' || this.isSuspended) return;
      if (pointerType === 'mouse' && !this.isPointing && document.pointerLockElement !== this.canvas) {
        // If the pointer cannot be locked, as on an iPad, dragging turns the view.
        void Promise.resolve(this.canvas.requestPointerLock?.()).catch(() => {});
      }
      this.looking ??= pointerId;
    });
    // Dragging with two fingers moves sideways and vertically; spreading them moves forward.
    const fingers = new TwoFingers(this.canvas, (right, down, apart) => {
      if (this.current !== 'fly' || this.isSuspended) return;
      this.go(-right * kFingerSpeed, down * kFingerSpeed, apart * kFingerSpeed);
    });
    const stop = ({ pointerId }: PointerEvent) => {
      if (this.looking === pointerId) this.looking = undefined;
    };
    addEventListener('pointerup', stop);
    addEventListener('pointercancel', stop);
    this.canvas.addEventListener('pointermove', ({ movementX, movementY, pointerId }) => {
      const isLocked = document.pointerLockElement === this.canvas;
      if (this.current !== 'fly' || this.isSuspended || fingers.areDown || (!isLocked && this.looking !== pointerId)) return;
      // A locked pointer drags the viewing direction; otherwise it drags the image.
      const sign = isLocked ? -1 : 1;
      this.turn(sign * movementX * kLookSpeed, sign * movementY * kLookSpeed);
    });
    this.canvas.addEventListener('wheel', (event) => {
      if (this.current !== 'fly') return;
      event.preventDefault();
      const factor = event.deltaY < 0 ? 1.2 : 1 / 1.2;
      this.speed = Math.min(Math.max(this.speed * factor, this.radius / 1000), 10 * this.radius);
    }, { passive: false });
  }
}
