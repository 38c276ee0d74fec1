// A page without user interface for tests and measurements, which draw views of a scene through `window.headlessPage`.
import * as THREE from 'three';
import { kYUpFromZUp } from './axes';
import { rendererName } from './draw/software-renderer';
import { TesseraScene, type SceneOptions } from './scene';
import { updateScenes } from './scenes';

const canvas = document.querySelector('canvas')!;
const renderer = new THREE.WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
const gl = renderer.getContext() as WebGL2RenderingContext;
const world = new THREE.Scene();
const camera = new THREE.PerspectiveCamera();
const several = new THREE.ArrayCamera();

// A pinhole camera: `matrix` is the column-major camera-to-capture-world matrix in OpenGL's axes; lengths are in
// pixels.
export interface View {
  matrix: number[];
  fx: number;
  fy: number;
  cx: number;
  cy: number;
  width: number;
  height: number;
  isParallel?: boolean; // a parallel projection: fx and fy are pixels per unit of the world
}

// Lays out several views beside one another.
function look(views: View | View[]): THREE.Camera {
  if (!Array.isArray(views)) {
    renderer.setSize(views.width, views.height, false);
    setCamera(camera, views);
    return camera;
  }
  let left = 0;
  several.cameras = views.map((view) => {
    const viewport = new THREE.Vector4(left, 0, view.width, view.height);
    left += view.width;
    const one = Object.assign(new THREE.PerspectiveCamera(), { viewport });
    setCamera(one, view);
    return one;
  });
  renderer.setSize(left, Math.max(...views.map(({ height }) => height)), false);
  return several;
}

function setCamera(camera: THREE.PerspectiveCamera, { matrix, fx, fy, cx, cy, width, height, isParallel }: View): void {
  camera.matrixAutoUpdate = false;
  camera.matrix.fromArray(matrix).premultiply(kYUpFromZUp);
  const near = 0.1;
  const sides = [-cx / fx, (width - cx) / fx, cy / fy, -(height - cy) / fy] as const;
  if (isParallel) {
    camera.projectionMatrix.makeOrthographic(...sides, near, 1e4);
  } else {
    const [left, right, top, bottom] = sides.map((side) => side * near);
    camera.projectionMatrix.makePerspective(left, right, top, bottom, near, 1e4);
  }
  camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  camera.updateMatrixWorld(true);
}

// Waits for the GPU, as pages that run ahead of it queue frames that nobody sees.
function draw(city: TesseraScene, camera: THREE.Camera): void {
  if (headlessPage.others.length > 0) updateScenes([city, ...headlessPage.others], camera, renderer);
  else city.update(camera, renderer);
  renderer.render(world, camera);
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

function shownScenes(): TesseraScene[] {
  const { city, others } = headlessPage;
  return others.length > 0 ? [city!, ...others].filter(({ visible }) => visible) : [city!];
}

// Updates until the visible scenes are in a state.
async function until(state: 'loaded' | 'idle', step: () => void, end: number): Promise<void> {
  do {
    if (performance.now() > end) throw new Error('the view does not come to rest');
    step();
    await new Promise((resolve) => setTimeout(resolve, 5));
  } while (shownScenes().some((scene) => !scene[state]));
}

const headlessPage = {
  THREE, renderer, world, camera,
  city: undefined as TesseraScene | undefined,
  others: [] as TesseraScene[], // further scenes in the same world
  errors: [] as string[],

  gpu(): string {
    return rendererName(gl);
  },

  async open(url: string, options: SceneOptions = {}): Promise<void> {
    this.city = await TesseraScene.load(url, options);
    this.city.onError = (error) => this.errors.push(error.message);
    world.background = this.city.background;
    world.add(this.city);
  },

  get beside(): TesseraScene | undefined {
    return this.others[0];
  },

  // Opens a further scene in the same world, at an offset from the first in the capture's world.
  async openBeside(url: string, away: number[], options: SceneOptions = {}): Promise<void> {
    const scene = await TesseraScene.load(url, options);
    scene.showsBackgroundBlock = false;
    scene.position.fromArray(away).applyMatrix4(kYUpFromZUp);
    this.others.push(scene);
    world.add(scene);
  },

  close(): void {
    this.city!.removeFromParent();
    this.city!.dispose();
  },

  // Loses and restores the WebGL context.
  async loseGpu(): Promise<void> {
    const extension = gl.getExtension('WEBGL_lose_context')!;
    const heard = (name: string) => new Promise((resolve) => canvas.addEventListener(name, resolve, { once: true }));
    const lost = heard('webglcontextlost');
    extension.loseContext();
    await lost;
    const restored = heard('webglcontextrestored');
    setTimeout(() => extension.restoreContext(), 50);
    await restored;
  },

  // Loads everything that the view requests, then draws it. Nothing is drawn in the meantime, as drawing is slow
  // without a GPU.
  async settle(view: View | View[], maximum = 60000): Promise<void> {
    const camera = look(view);
    const end = performance.now() + maximum;
    do {
      await until('loaded', () => shownScenes().forEach((scene) => scene.prefetch(camera, renderer)), end);
      do draw(this.city!, camera);
      while (shownScenes().some(({ loaded, idle }) => loaded && !idle));
    } while (shownScenes().some(({ idle }) => !idle));
  },

  // Draws what is resident at each step until everything that the view requests is loaded, as the viewer does.
  async drawUntilSettled(view: View | View[], maximum = 60000): Promise<void> {
    const camera = look(view);
    await until('idle', () => draw(this.city!, camera), performance.now() + maximum);
  },

  // Draws an image `frames` times and returns the seconds of each frame.
  times(view: View, times: number): number[] {
    const looking = look(view);
    return Array.from({ length: times }, () => {
      const begin = performance.now();
      draw(this.city!, looking);
      return (performance.now() - begin) / 1000;
    });
  },

  // Returns the shortest of these times.
  time(view: View, times: number): number {
    return Math.min(...this.times(view, times));
  },

  // Adds a red box to the world; scene units.
  addBox(low: number[], high: number[]): void {
    const box = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
    const mesh = new THREE.Mesh(
      new THREE.BoxGeometry(...box.getSize(new THREE.Vector3()).toArray()), new THREE.MeshBasicMaterial({ color: 0xff0000 }));
    mesh.name = 'box';
    this.city!.updateMatrixWorld();
    mesh.applyMatrix4(new THREE.Matrix4().makeTranslation(box.getCenter(new THREE.Vector3())));
    mesh.applyMatrix4(this.city!.localFromScene);
    mesh.applyMatrix4(this.city!.matrixWorld);
    world.add(mesh);
  },

  // Draws nothing of the scene in these boxes; scene units.
  hide(boxes: { low: number[]; high: number[] }[]): void {
    this.city!.hidden = boxes.map(({ low, high }) => {
      const box = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
      const size = box.getSize(new THREE.Vector3());
      const inScene = new THREE.Matrix4().makeScale(size.x, size.y, size.z).setPosition(box.getCenter(new THREE.Vector3()));
      return this.city!.localFromScene.clone().multiply(inScene);
    });
  },

  // Returns what `pick` returns for the last image, at coordinates from -1 to 1; scene units.
  surfaceAt(x: number, y: number): number[] | undefined {
    const place = this.city!.pick(new THREE.Vector2(x, y), renderer);
    return place && this.city!.worldToLocal(place).applyMatrix4(this.city!.localFromScene.clone().invert()).toArray();
  },

  // Adds red cubes at these centres in the capture's world, with half an edge each.
  addCubes(cubes: { middle: number[]; half: number }[]): void {
    const mesh = new THREE.InstancedMesh(
      new THREE.BoxGeometry(2, 2, 2), new THREE.MeshBasicMaterial({ color: 0xff0000 }), cubes.length);
    mesh.name = 'box';
    mesh.frustumCulled = false;
    cubes.forEach(({ middle, half }, i) =>
      mesh.setMatrixAt(i, new THREE.Matrix4().makeScale(half, half, half).setPosition(...(middle as [number, number, number]))));
    mesh.applyMatrix4(kYUpFromZUp);
    world.add(mesh);
  },

  // Removes what addBox or addCubes has added.
  removeBox(): void {
    const box = world.getObjectByName('box') as THREE.Mesh;
    box.removeFromParent();
    box.geometry.dispose();
    for (const material of [box.material].flat()) material.dispose();
  },

  // Returns the canvas as RGB in base64, rows from the top.
  pixels(): string {
    const { width, height } = canvas;
    const read = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, read);
    let text = '';
    for (let y = height - 1; y >= 0; --y) {
      for (let x = 0; x < width; ++x) {
        const at = 4 * (x + width * y);
        text += String.fromCharCode(read[at], read[at + 1], read[at + 2]);
      }
    }
    return btoa(text);
  },
};

export type HeadlessPage = typeof headlessPage;
Object.assign(window, { headlessPage });
