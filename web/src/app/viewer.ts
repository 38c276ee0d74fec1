// Scenes on a canvas: the world they stand in, the camera, and when a picture is drawn. What the tools of the application
// share.
import * as THREE from 'three';
import type { SceneStatistics, StreamSettings, TesseraScene } from '../scene';
import { SceneError } from '../scene-error';
import { updateScenes } from '../scenes';
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

const kVisibility = 1; // diagonals of what was captured
const kBytesPerPixel = 37; // of a scene's pictures, and of the depth of what is opaque

export class Viewer {
  readonly world = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(50);
  readonly navigation: Navigation;
  readonly resolution = new Resolution();
  // Called after each picture.
  readonly onFrame = new Set<(frame: Frame) => void>();
  // Called where somebody clicked, or tapped, without dragging; the first that answers true takes it.
  readonly onClick: ((event: PointerEvent) => boolean)[] = [];
  readonly scenes: TesseraScene[]; // the city first
  readonly onScenes = new Set<() => void>(); // of the list, of what is visible
  private readonly stream: StreamSettings; // of all scenes together
  private cardBudget: number;
  private mover: Mover;
  private needed = true; // a picture, though nothing moves
  private held = false;

  // The city is in the world, at the origin; its frame is that of all that stands there.
  constructor(
    readonly canvas: HTMLCanvasElement,
    readonly renderer: THREE.WebGLRenderer,
    readonly city: TesseraScene,
  ) {
    this.world.background = city.background;
    this.world.add(city);
    this.scenes = [city];
    city.visibility = kVisibility;
    this.stream = { ...city.stream };
    this.cardBudget = city.stream.cardBytes;
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

  // At once; flyTo takes its time. Neither does anything while somebody else draws.
  set view({ eye, target, fov }: View) {
    if (this.held) return;
    this.setLens(fov);
    this.mover.look = { eye, target };
  }

  flyTo({ eye, target, fov }: View): void {
    if (this.held) return;
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

  // Another one beside the city, which is drawn in the same way, up to the box of what was captured.
  addScene(scene: TesseraScene): void {
    const { city } = this;
    Object.assign(scene.selection, city.selection);
    Object.assign(scene, { display: city.display, onError: city.onError, resolutionScale: city.resolutionScale, showsSurround: false });
    this.scenes.push(scene);
    this.world.add(scene);
    this.changedScenes();
  }

  // Not the city. Gives its memory back.
  removeScene(scene: TesseraScene): void {
    this.scenes.splice(this.scenes.indexOf(scene), 1);
    scene.removeFromParent();
    scene.dispose();
    this.changedScenes();
  }

  changedScenes(): void {
    const bounds = new THREE.Box3();
    for (const scene of this.scenes) if (!scene.visible) scene.leaveCard();
    for (const scene of this.visibleScenes) {
      scene.updateWorldMatrix(true, false);
      bounds.union(scene.bounds.applyMatrix4(scene.matrixWorld));
    }
    if (!bounds.isEmpty()) this.navigation.bounds = bounds;
    for (const tell of this.onScenes) tell();
    this.needPicture();
  }

  // Of the graphics card, for all scenes together.
  set cardBytes(bytes: number) {
    this.cardBudget = bytes;
    this.needPicture();
  }

  private get visibleScenes(): TesseraScene[] {
    return this.scenes.filter(({ visible }) => visible);
  }

  // Each scene has pictures of its own; all of them get no more than half of the card.
  private get mostScale(): number {
    const { x, y } = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    return Math.min(1, Math.sqrt((0.5 * this.cardBudget) / (kBytesPerPixel * x * y * Math.max(1, this.visibleScenes.length))));
  }

  // Of all scenes, which share the card, the page and the network.
  set resolutionScale(resolutionScale: number) {
    const scenes = this.visibleScenes;
    const { pageBytes, fetches } = this.stream;
    for (const scene of scenes) {
      scene.resolutionScale = resolutionScale;
      scene.largestResolutionScale = Math.min(this.resolution.whole, this.mostScale);
      scene.stream.cardBytes = this.cardBudget / scenes.length;
      scene.stream.pageBytes = pageBytes / scenes.length;
      scene.stream.fetches = Math.max(1, Math.floor(fetches / scenes.length));
    }
  }

  // Nothing that the last view asked for is still to come.
  get idle(): boolean {
    return this.visibleScenes.every(({ idle }) => idle);
  }

  // Of all scenes together.
  get statistics(): SceneStatistics | undefined {
    const all = this.scenes.map(({ statistics }) => statistics).filter((one) => one !== undefined);
    if (all.length === 0) return undefined;
    return all.reduce((sum, one) => {
      const drawn = Array.from({ length: Math.max(sum.drawn.length, one.drawn.length) }, (_, i) => (sum.drawn[i] ?? 0) + (one.drawn[i] ?? 0));
      const added = Object.entries(one).map(([key, value]) => [key, (sum[key as keyof SceneStatistics] as number) + (value as number)]);
      return { ...(Object.fromEntries(added) as SceneStatistics), drawn };
    });
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

  // The place of the world under the pointer: of a scene, or of a model in front of it.
  pickAt(event: { clientX: number; clientY: number }): THREE.Vector3 | undefined {
    const at = this.pointerAt(event);
    const raycaster = new THREE.Raycaster();
    raycaster.setFromCamera(at, this.camera);
    const isOther = (child: THREE.Object3D) => !(this.scenes as THREE.Object3D[]).includes(child) && child.visible && !child.userData.isTool;
    const hit = raycaster.intersectObjects(this.world.children.filter(isOther))[0];
    const place = this.pickScenes(at);
    if (!hit || (place && place.distanceTo(this.eye) < hit.distance)) return place;
    return hit.point;
  }

  // Of the scenes alone: the nearest; `at` runs from -1 to 1 across the picture.
  pickScenes(at: THREE.Vector2): THREE.Vector3 | undefined {
    const distance = (place: THREE.Vector3) => place.distanceTo(this.eye);
    const places = this.scenes.map((scene) => (scene.visible ? scene.pick(at, this.renderer) : undefined));
    return places.filter((place) => place !== undefined).sort((a, b) => distance(a) - distance(b))[0];
  }

  // Of the world, whatever group the camera is in.
  get eye(): THREE.Vector3 {
    return this.camera.getWorldPosition(new THREE.Vector3());
  }

  // Has the loop wait, and the camera and what is seen stay, while somebody else draws.
  async whileHeld<T>(work: () => Promise<T>): Promise<T> {
    if (this.renderer.xr.isPresenting) throw new Error('a headset shows the scene; leave it first');
    const still = this.still();
    this.held = true;
    this.navigation.enabled = false;
    try {
      return await work();
    } finally {
      this.held = false;
      this.navigation.enabled = true;
      this.resize(); // of which nothing was to be heard meanwhile
      const drawn = () => {
        still.remove();
        this.onFrame.delete(drawn);
      };
      this.onFrame.add(drawn);
    }
  }

  // The picture as it is, over the canvas.
  private still(): HTMLCanvasElement {
    const still = document.createElement('canvas');
    still.className = 'still';
    still.width = this.canvas.width;
    still.height = this.canvas.height;
    this.draw(); // of the one before, browsers keep nothing
    still.getContext('2d')!.drawImage(this.canvas, 0, 0);
    this.canvas.after(still);
    return still;
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
    let motion = this.resolution.motion(0); // when it was drawn
    let last = performance.now();
    const timer = new GpuTimer(this.renderer);
    this.renderer.setAnimationLoop(() => {
      const now = performance.now();
      const milliseconds = now - last;
      last = now;
      if (this.held) return;
      if (this.mover.update(milliseconds / 1000)) this.resolution.moved(now);
      const before = motion;
      motion = this.resolution.motion(now);
      if (motion === 'rest' && wasWhole && this.idle && !this.needed) return;
      if (motion === before) this.resolution.took(milliseconds, motion);
      this.needed = false;
      const resolutionScale = Math.min(this.resolution.scale(now), this.mostScale);
      this.resolutionScale = resolutionScale;
      timer.measure(() => this.draw());
      wasWhole = resolutionScale === Math.min(this.resolution.whole, this.mostScale);
      const frame = { milliseconds, gpuMilliseconds: timer.milliseconds, resolutionScale };
      for (const tell of this.onFrame) tell(frame);
    });
  }

  // Streams in what a picture would show, without drawing it.
  prefetch(): void {
    for (const scene of this.visibleScenes) scene.prefetch(this.camera, this.renderer);
  }

  draw(): void {
    updateScenes(this.scenes, this.camera, this.renderer);
    this.renderer.render(this.world, this.camera);
  }

  private watchClicks(): void {
    const slack = (pointerType: string) => (pointerType === 'mouse' ? 5 : 10); // pixels
    let down: { x: number; y: number; id: number } | undefined;
    this.canvas.addEventListener('pointerdown', ({ clientX: x, clientY: y, pointerId: id, button, isPrimary }) => {
      down = button === 0 && isPrimary ? { x, y, id } : undefined;
    });
    this.canvas.addEventListener('pointerup', (event) => {
      const isClick =
        down?.id === event.pointerId && Math.hypot(event.clientX - down.x, event.clientY - down.y) < slack(event.pointerType);
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
