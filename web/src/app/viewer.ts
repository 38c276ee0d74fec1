// A scene on a canvas: the world it stands in, the camera, and when a picture is drawn. What the tools of the application
// share.
import * as THREE from 'three';
import { TesseraScene } from '../scene';
import { SceneError } from '../scene-error';
import { Navigation, type Look } from './moving/navigation';
import { Resolution, type Pace } from './moving/resolution';
import { GpuTimer } from './page/gpu-timer';
import type { View } from './views/view-address';

export interface Frame {
  milliseconds: number; // since the last one
  gpuMilliseconds?: number; // that the graphics card drew a picture shortly before, where it tells
  resolutionScale: number;
}

// Moves the camera.
export interface Mover {
  look: Look; // set: at once
  flyTo(look: Look): void;
  update(seconds: number): boolean; // once a frame; true where the camera has moved
}

export class Viewer {
  readonly world = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(50);
  readonly navigation: Navigation;
  readonly resolution = new Resolution();
  // Called after each picture.
  readonly onFrame = new Set<(frame: Frame) => void>();
  // Called where somebody clicked, or tapped, without dragging; the first that answers true takes it.
  readonly onClick: ((event: PointerEvent) => boolean)[] = [];
  private mover: Mover;
  private needed = true; // a picture, though nothing moves
  private held = false;

  // The city is in the world, at the origin.
  constructor(
    readonly canvas: HTMLCanvasElement,
    readonly renderer: THREE.WebGLRenderer,
    readonly city: TesseraScene,
  ) {
    this.world.background = city.background;
    this.world.add(city);
    this.navigation = new Navigation(this.camera, canvas, city.bounds, (event) => this.pickAt(event));
    this.mover = this.navigation;
    addEventListener('resize', () => this.resize());
    this.resize();
    this.navigation.showAll();
    this.watchClicks();
    this.run();
  }

  get view(): View {
    return { ...this.mover.look, fov: this.camera.fov };
  }

  // At once; flyTo takes its time.
  set view({ eye, target, fov }: View) {
    this.setLens(fov);
    this.mover.look = { eye, target };
  }

  flyTo({ eye, target, fov }: View): void {
    this.setLens(fov);
    this.mover.flyTo({ eye, target });
  }

  // Has something else than mouse and keys move the camera, at a pace of its own; without: them again.
  takeOver(mover: Mover = this.navigation, pace?: Pace): void {
    this.mover = mover;
    this.navigation.enabled = mover === this.navigation;
    this.resolution.pace = pace;
    this.resize(); // of which nothing was to be heard meanwhile
  }

  // Somebody has changed what is to be seen.
  needPicture(): void {
    this.needed = true;
  }

  // Where the pointer is in the picture: from -1 to 1 across it, upwards.
  pointerAt({ clientX, clientY }: { clientX: number; clientY: number }): THREE.Vector2 {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return new THREE.Vector2((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height);
  }

  // The place of the world under the pointer: of the city, or of a model in front of it.
  pickAt(event: { clientX: number; clientY: number }): THREE.Vector3 | undefined {
    const at = this.pointerAt(event);
    const raycaster = new THREE.Raycaster();
    raycaster.setFromCamera(at, this.camera);
    const hit = raycaster.intersectObjects(this.world.children.filter((child) => child !== this.city && child.visible && !child.userData.isTool))[0];
    const place = this.city.pick(at, this.renderer);
    if (!hit || (place && place.distanceTo(this.camera.getWorldPosition(new THREE.Vector3())) < hit.distance)) return place;
    return hit.point;
  }

  // Has the loop wait, and the camera stay, while somebody else draws.
  async whileHeld<T>(work: () => Promise<T>): Promise<T> {
    if (this.renderer.xr.isPresenting) throw new Error('a headset shows the scene; leave it first');
    this.held = true;
    this.navigation.enabled = false;
    try {
      return await work();
    } finally {
      this.held = false;
      this.navigation.enabled = true;
      this.resize(); // of which nothing was to be heard meanwhile
    }
  }

  get isHeld(): boolean {
    return this.held;
  }

  private setLens(fov: number): void {
    this.camera.fov = fov;
    this.camera.updateProjectionMatrix();
    this.needPicture();
  }

  private resize(): void {
    if (this.held || this.renderer.xr.isPresenting) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(innerWidth, innerHeight, false);
    this.camera.aspect = innerWidth / innerHeight;
    this.camera.updateProjectionMatrix();
    this.needPicture();
  }

  private run(): void {
    let wasWhole = false; // the last picture was
    let wasMoving = false; // when it was drawn
    let before = performance.now();
    const timer = new GpuTimer(this.renderer);
    this.renderer.setAnimationLoop(() => {
      const now = performance.now();
      const milliseconds = now - before;
      before = now;
      if (this.held) return;
      if (this.mover.update(milliseconds / 1000)) this.resolution.moved(now);
      const isMoving = !this.resolution.isResting(now);
      if (!isMoving && wasWhole && this.city.idle && !this.needed) return;
      if (isMoving && wasMoving) this.resolution.took(milliseconds);
      wasMoving = isMoving;
      this.needed = false;
      this.city.resolutionScale = this.resolution.scale(now);
      timer.measure(() => this.draw());
      wasWhole = this.city.resolutionScale === this.resolution.whole;
      const frame = { milliseconds, gpuMilliseconds: timer.milliseconds, resolutionScale: this.city.resolutionScale };
      for (const tell of this.onFrame) tell(frame);
    });
  }

  draw(): void {
    this.city.update(this.camera, this.renderer);
    this.renderer.render(this.world, this.camera);
  }

  private watchClicks(): void {
    const kSlack = 5; // pixels
    let down: { x: number; y: number; id: number } | undefined;
    this.canvas.addEventListener('pointerdown', ({ clientX: x, clientY: y, pointerId: id, button, isPrimary }) => {
      down = button === 0 && isPrimary ? { x, y, id } : undefined;
    });
    this.canvas.addEventListener('pointerup', (event) => {
      const isClick =
        down?.id === event.pointerId && Math.hypot(event.clientX - down.x, event.clientY - down.y) < kSlack;
      down = undefined;
      // In flight a click with the mouse takes hold of the pointer, which then is nowhere.
      const isForFlight = this.navigation.mode === 'fly' && event.pointerType === 'mouse' && !this.navigation.isPointing;
      if (isClick && !isForFlight) this.onClick.some((take) => take(event));
    });
  }
}

// Throws SceneError where the browser cannot draw.
export function makeRenderer(canvas: HTMLCanvasElement): THREE.WebGLRenderer {
  try {
    return new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: 'high-performance' });
  } catch {
    throw new SceneError('browser', '', 'has no WebGL 2', 'allow hardware acceleration in its settings, or use another');
  }
}
