// The viewer: scenes on a canvas, the world that they are in, the camera, and the render loop, which the tools of the
// application share.
import * as THREE from 'three';
import type { SceneStatistics, StreamSettings, TesseraScene } from '../scene';
import { SceneError } from '../scene-error';
import { updateScenes } from '../scenes';
import { Navigation, type Look } from './moving/navigation';
import { Resolution, type ResolutionTarget } from './moving/resolution';
import { GpuTimer } from './page/gpu-timer';
import type { View } from './views/view-address';

export interface Frame {
  milliseconds: number; // since the last frame
  gpuMilliseconds?: number; // GPU time of a recent frame, if the browser reports it
  resolutionScale: number;
}

// Moves the camera.
export interface Mover {
  look: Look; // setting it takes effect at once
  flyTo(look: Look): void;
  update(seconds: number): boolean; // called once a frame; returns true if the camera has moved
}

const kLeastBudget = 64 * 2 ** 20; // bytes

const kVisibility = 1; // as a multiple of the diagonal of the captured region

export class Viewer {
  readonly world = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(50);
  readonly navigation: Navigation;
  readonly resolution = new Resolution();
  // Called after each frame.
  readonly onFrame = new Set<(frame: Frame) => void>();
  // Called when the user clicks or taps without dragging; the first callback that returns true handles the click.
  readonly onClick: ((event: PointerEvent) => boolean)[] = [];
  readonly scenes: TesseraScene[]; // the city first
  readonly onScenes = new Set<() => void>(); // called when the list or the visibility of a scene changes
  private readonly stream: StreamSettings; // the budget of all scenes together
  private gpuBudget: number;
  private mover: Mover;
  private needed = true; // a frame is needed although nothing moves
  private paused = false;

  // The city is at the world's origin; its frame is that of everything in the world.
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
    this.gpuBudget = city.stream.gpuBytes;
    this.navigation = new Navigation(this.camera, canvas, city.bounds, (event) => this.pickAt(event));
    this.mover = this.navigation;
    addEventListener('resize', () => this.resize());
    canvas.addEventListener('webglcontextlost', () => this.saveMemory());
    this.resize();
    this.navigation.showAll();
    this.watchClicks();
    this.run();
  }

  get view(): View {
    return { ...this.mover.look, fov: this.camera.fov };
  }

  // Takes effect at once; flyTo is animated. Neither does anything while the loop is paused.
  set view({ eye, target, fov }: View) {
    if (this.paused) return;
    this.setLens(fov);
    this.mover.look = { eye, target };
  }

  flyTo({ eye, target, fov }: View): void {
    if (this.paused) return;
    this.setLens(fov);
    this.mover.flyTo({ eye, target });
  }

  // Replaces navigation by another mover of the camera, with its own resolution target; without arguments, restores
  // navigation.
  takeOver(mover: Mover = this.navigation, pace?: ResolutionTarget): void {
    this.mover = mover;
    this.navigation.enabled = mover === this.navigation;
    this.resolution.pace = pace;
    this.resize(); // resize events were not delivered in the meantime
  }

  // Adds a scene beside the city; it is drawn in the same way, but only inside its bounds.
  addScene(scene: TesseraScene): void {
    const { city } = this;
    Object.assign(scene.selection, city.selection);
    Object.assign(scene, { display: city.display, featureLevel: city.featureLevel, onError: city.onError, resolutionScale: city.resolutionScale, showsBackgroundBlock: false });
    this.scenes.push(scene);
    this.world.add(scene);
    this.changedScenes();
  }

  // Removes a scene other than the city, and frees its memory.
  removeScene(scene: TesseraScene): void {
    this.scenes.splice(this.scenes.indexOf(scene), 1);
    scene.removeFromParent();
    scene.dispose();
    this.changedScenes();
  }

  changedScenes(): void {
    const bounds = new THREE.Box3();
    for (const scene of this.scenes) if (!scene.visible) scene.leaveGpu();
    for (const scene of this.visibleScenes) {
      scene.updateWorldMatrix(true, false);
      bounds.union(scene.bounds.applyMatrix4(scene.matrixWorld));
    }
    if (!bounds.isEmpty()) this.navigation.bounds = bounds;
    for (const tell of this.onScenes) tell();
    this.needPicture();
  }

  // GPU budget of all scenes together.
  get gpuBytes(): number {
    return this.gpuBudget;
  }
  set gpuBytes(bytes: number) {
    this.gpuBudget = bytes;
    this.needPicture();
  }

  // A browser that takes the GPU away from a visible page is likely to lack memory for what this page draws, and would
  // take it away again. Hidden pages lose it for many reasons.
  private saveMemory(): void {
    if (document.visibilityState === 'visible') this.gpuBytes = Math.min(this.gpuBudget, Math.max(kLeastBudget, this.gpuBudget / 2));
  }

  private get visibleScenes(): TesseraScene[] {
    return this.scenes.filter(({ visible }) => visible);
  }

  // Each scene has its own render targets; together they take at most half of the GPU budget.
  private get maxScale(): number {
    const { x, y } = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    const bytesPerPixel = this.visibleScenes.reduce((sum, scene) => sum + scene.bytesPerPixel, 0);
    return Math.min(1, Math.sqrt((0.5 * this.gpuBudget) / Math.max(1, bytesPerPixel * x * y)));
  }

  // Distributes the budget to the scenes, which share the GPU, the page and the network.
  set resolutionScale(resolutionScale: number) {
    const scenes = this.visibleScenes;
    const { pageBytes, fetches } = this.stream;
    for (const scene of scenes) {
      scene.resolutionScale = resolutionScale;
      scene.largestResolutionScale = Math.min(this.resolution.whole, this.maxScale);
      scene.stream.gpuBytes = this.gpuBudget / scenes.length;
      scene.stream.pageBytes = pageBytes / scenes.length;
      scene.stream.fetches = Math.max(1, Math.floor(fetches / scenes.length));
    }
  }

  // True when nothing that the last view requested is still to be loaded.
  get loaded(): boolean {
    return this.visibleScenes.every(({ loaded }) => loaded);
  }

  get idle(): boolean {
    return this.visibleScenes.every(({ idle }) => idle);
  }

  // The statistics of all scenes together.
  get statistics(): SceneStatistics | undefined {
    const all = this.scenes.map(({ statistics }) => statistics).filter((one) => one !== undefined);
    if (all.length === 0) return undefined;
    return all.reduce((sum, one) => {
      const drawn = Array.from({ length: Math.max(sum.drawn.length, one.drawn.length) }, (_, i) => (sum.drawn[i] ?? 0) + (one.drawn[i] ?? 0));
      const added = Object.entries(one).map(([key, value]) => [key, (sum[key as keyof SceneStatistics] as number) + (value as number)]);
      return { ...(Object.fromEntries(added) as SceneStatistics), drawn };
    });
  }

  // Requests a frame after a visible change.
  needPicture(): void {
    this.needed = true;
  }

  // Returns the pointer's position in the image: from -1 to 1, y upwards.
  pointerAt({ clientX, clientY }: { clientX: number; clientY: number }): THREE.Vector2 {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return new THREE.Vector2((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height);
  }

  // Returns the place in the world under the pointer: of a scene, or of a model in front of it.
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

  // Considers the scenes alone and returns the nearest place; `at` runs from -1 to 1 across the image.
  pickScenes(at: THREE.Vector2): THREE.Vector3 | undefined {
    const distance = (place: THREE.Vector3) => place.distanceTo(this.eye);
    const places = this.scenes.map((scene) => (scene.visible ? scene.pick(at, this.renderer) : undefined));
    return places.filter((place) => place !== undefined).sort((a, b) => distance(a) - distance(b))[0];
  }

  // Returns the camera's position in the world, whatever group it is in.
  get eye(): THREE.Vector3 {
    return this.camera.getWorldPosition(new THREE.Vector3());
  }

  // Pauses the loop, the camera and changes to the view while the caller draws.
  async whileHeld<T>(work: () => Promise<T>): Promise<T> {
    if (this.renderer.xr.isPresenting) throw new Error('a headset shows the scene; leave it first');
    const still = this.still();
    this.paused = true;
    this.navigation.enabled = false;
    try {
      return await work();
    } finally {
      this.paused = false;
      this.navigation.enabled = true;
      this.resize(); // resize events were not delivered in the meantime
      const drawn = () => {
        still.remove();
        this.onFrame.delete(drawn);
      };
      this.onFrame.add(drawn);
    }
  }

  // Covers the canvas with a still copy of the current image.
  private still(): HTMLCanvasElement {
    const still = document.createElement('canvas');
    still.className = 'still';
    still.width = this.canvas.width;
    still.height = this.canvas.height;
    this.draw(); // browsers do not preserve the previous image
    still.getContext('2d')!.drawImage(this.canvas, 0, 0);
    this.canvas.after(still);
    return still;
  }

  get isPaused(): boolean {
    return this.paused;
  }

  private setLens(fov: number): void {
    this.camera.fov = fov;
    this.camera.updateProjectionMatrix();
    this.needPicture();
  }

  private resize(): void {
    if (this.paused || this.renderer.xr.isPresenting) return;
    if (innerWidth === 0 || innerHeight === 0) return; // a frame that is not shown yet
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(innerWidth, innerHeight, false);
    this.camera.aspect = innerWidth / innerHeight;
    this.camera.updateProjectionMatrix();
    this.needPicture();
  }

  private run(): void {
    let wasWhole = false; // the last frame had full resolution
    let motion = this.resolution.motion(0); // while the last frame was drawn
    let last = performance.now();
    const timer = new GpuTimer(this.renderer);
    this.renderer.setAnimationLoop(() => {
      const now = performance.now();
      const milliseconds = now - last;
      last = now;
      if (this.paused) return;
      if (this.mover.update(milliseconds / 1000)) this.resolution.moved(now);
      const before = motion;
      motion = this.resolution.motion(now);
      if (motion === 'rest' && wasWhole && this.idle && !this.needed) return;
      if (motion === before) this.resolution.took(milliseconds, motion);
      this.needed = false;
      const resolutionScale = Math.min(this.resolution.scale(now), this.maxScale);
      this.resolutionScale = resolutionScale;
      timer.measure(() => this.draw());
      wasWhole = resolutionScale === Math.min(this.resolution.whole, this.maxScale);
      const frame = { milliseconds, gpuMilliseconds: timer.milliseconds, resolutionScale };
      for (const tell of this.onFrame) tell(frame);
    });
  }

  // Streams the tiles that a frame would show, without drawing it.
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
      // In fly mode, a click locks the mouse pointer, which then has no position.
      const isForFlight = this.navigation.mode === 'fly' && event.pointerType === 'mouse' && !this.navigation.isPointing;
      if (isClick && !isForFlight) this.onClick.some((take) => take(event));
    });
  }
}

// Throws SceneError if the browser cannot draw.
export function makeRenderer(canvas: HTMLCanvasElement): THREE.WebGLRenderer {
  try {
    return new THREE.WebGLRenderer({ canvas, antialias: false, powerPreference: 'high-performance' });
  } catch {
    throw new SceneError('browser', '', 'has no WebGL 2', 'allow hardware acceleration in its settings, or use another');
  }
}
