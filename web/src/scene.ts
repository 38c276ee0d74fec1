// A tessera scene as an object of three.js:
//
//   const city = await TesseraScene.load(url);
//   world.add(city, car);
//   // each frame:
//   city.update(camera, renderer);
//   renderer.render(world, camera);
//
// `update` streams in what the camera asks for and draws the scene into targets of its own, up to what opaque objects of
// the same world hide; `render` then shows it among them. Its own frame is the capture's, turned from z up to y up, in
// metres where the capture has a scale. Where several stand in one world, see scenes.ts.
import * as THREE from 'three';
import { kYUpFromZUp } from './axes';
import { DecodePool } from './decode-pool';
import { cityMesh, kFirstRenderOrder } from './draw/city-mesh';
import { Compositor, type DrawnContent } from './draw/compositor';
import { kDisplayModes, type DisplayMode } from './draw/display-modes';
import { OpaqueDepth } from './draw/opaque-depth';
import { SceneError } from './scene-error';
import { ServedFiles, type ContentFile, type SceneFiles } from './scene-files';
import { TileSelector, kSelectionSettings, type SelectionSettings } from './stream/tile-selector';
import { coarsestTiles, tileTree, type TileTree } from './stream/tile-tree';
import { TileView, type Plane } from './stream/tile-view';
import { kStreamSettings, TileStreamer, type StreamSettings, type StreamStatistics } from './stream/tile-streamer';
import { decodeTileset } from './tiles/decode-tileset';
import type { Tileset, Vec3 } from './tiles/tileset';
import type { VolumeContent } from './tiles/volume-content';
import { VolumeSource } from './volume-source';

const kTilesetBytes = 1 << 24;

export interface SceneOptions {
  selection?: Partial<SelectionSettings>;
  stream?: Partial<StreamSettings>;
}

export interface SceneStatistics extends StreamStatistics {
  targetBytes: number; // of the pictures that it is drawn into
  drawn: number[]; // tiles of each level in the last picture
}

// What other scenes of the same world are to this one (scenes.ts).
export interface Neighbours {
  behind: readonly TesseraScene[]; // drawn already: their surfaces end its rays
  boxes: readonly THREE.Matrix4[]; // in which its surround is not drawn, as `hidden` has them
}

type Streamer = TileStreamer<ContentFile, VolumeContent, DrawnContent>;

export class TesseraScene extends THREE.Object3D {
  readonly localFromScene = new THREE.Matrix4(); // of this object, from the scene's units
  readonly selection: SelectionSettings;
  readonly stream: StreamSettings;
  resolutionScale = 1; // pixels of the scene beside those of the canvas, along an edge
  display: DisplayMode = 'colour';
  minTransmittance = 1 / 255; // rays end where less would be seen; 0: never
  // Boxes in which nothing of it is drawn, at most kMostHiddenBoxes: from the cube of edge 1 about the origin to this
  // object's frame.
  hidden: THREE.Matrix4[] = [];
  showsSurround = true; // false: nothing outside of `bounds` is drawn
  neighbours: Neighbours = { behind: [], boxes: [] };
  // Of tiles that cannot be had, and of a budget that is too small; told once each.
  onError: (error: SceneError) => void = () => {};
  private readonly tree: TileTree;
  private readonly opaque = new OpaqueDepth();
  private compositor?: Compositor;
  private streamer?: Streamer;
  private mesh?: ReturnType<typeof cityMesh>;
  private drawn: number[] = [];
  private lastUpdate = 0;
  private disposed = false;
  private canvas?: EventTarget;
  // What was on the card is gone: all is fetched anew when there is a card again.
  private readonly onContextLost = () => this.leaveCard();

  // From the address of a scene's folder (or of the tileset.json in it), or other files. Throws SceneError where there is
  // no scene, or one of another kind.
  static async load(from: string | SceneFiles, options: SceneOptions = {}): Promise<TesseraScene> {
    const files = typeof from === 'string' ? new ServedFiles(from) : from;
    const pool = new DecodePool();
    pool.start(options.stream?.decodes ?? kStreamSettings.decodes);
    try {
      return new TesseraScene(await openTileset(files), files, options, pool);
    } catch (error) {
      pool.dispose();
      throw error;
    }
  }

  private constructor(
    readonly tileset: Tileset,
    readonly files: SceneFiles,
    options: SceneOptions,
    private readonly pool: DecodePool,
  ) {
    super();
    this.name = tileset.name;
    this.selection = { ...kSelectionSettings, ...options.selection };
    this.stream = { ...kStreamSettings, ...options.stream };
    this.tree = tileTree(tileset, 'tileset.json');
    const { rotation: r, scale, translation: t } = tileset.worldFromScene;
    this.localFromScene.set(
      r[0] * scale, r[3] * scale, r[6] * scale, t[0],
      r[1] * scale, r[4] * scale, r[7] * scale, t[1],
      r[2] * scale, r[5] * scale, r[8] * scale, t[2],
      0, 0, 0, 1);
    this.localFromScene.premultiply(kYUpFromZUp);
  }

  // The box of what was captured, in this object's frame.
  get bounds(): THREE.Box3 {
    const { low, high } = this.tileset.box;
    return new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high)).applyMatrix4(this.localFromScene);
  }

  // What is behind everything.
  get background(): THREE.Color {
    return new THREE.Color().setRGB(...this.tileset.background, THREE.SRGBColorSpace);
  }

  // The coarsest level and the surround are there, or cannot be had.
  get complete(): boolean {
    return this.streamer?.complete ?? false;
  }

  // Nothing that the last view asked for is still to come.
  get idle(): boolean {
    return this.complete && (this.streamer?.idle ?? false);
  }

  get statistics(): SceneStatistics | undefined {
    if (!this.streamer || !this.compositor) return undefined;
    return { ...this.streamer.statistics, targetBytes: this.compositor.bytes + this.opaque.bytes, drawn: this.drawn };
  }

  update(camera: THREE.Camera, renderer: THREE.WebGLRenderer): void {
    if (this.disposed || renderer.getContext().isContextLost()) return;
    const { compositor, streamer, mesh } = this.prepare(renderer);
    this.updateWorldMatrix(true, false);
    camera.updateWorldMatrix(true, false);
    const worldFromScene = this.matrixWorld.clone().multiply(this.localFromScene);
    const size = renderer.getDrawingBufferSize(new THREE.Vector2()).multiplyScalar(this.resolutionScale).round().max(new THREE.Vector2(1, 1));
    const surfaces = this.neighbours.behind.map((scene) => scene.mesh).filter((one) => one !== undefined);
    const depth = this.opaque.draw(renderer, camera, this, size, new Set(surfaces));
    compositor.resize(size);
    streamer.settings = { ...this.stream, cardBytes: this.stream.cardBytes - compositor.bytes - this.opaque.bytes };
    const { cut, surround } = streamer.update(tileView(this.tileset, camera, worldFromScene, size), this.uploadTime());
    const frontToBack = cut
      .filter(({ visible }) => visible)
      .map(({ tile }) => streamer.residentOf(tile))
      .filter((content) => content !== undefined);
    // What it surrounds comes first: on slow machines a picture of it alone would only take time.
    const behind = streamer.complete && this.showsSurround ? streamer.residentOf(surround) : undefined;
    if (behind) frontToBack.push(behind);
    this.drawn = new Array<number>(this.tileset.levels).fill(0);
    for (const { tile, visible } of cut) if (visible) ++this.drawn[this.tree.tiles[tile].level];
    compositor.view.minTransmittance.value = this.minTransmittance;
    compositor.view.display.value = kDisplayModes.indexOf(this.display);
    const sceneFromLocal = this.localFromScene.clone().invert();
    const inScene = (boxes: readonly THREE.Matrix4[]) => boxes.map((box) => sceneFromLocal.clone().multiply(box));
    compositor.hide(inScene(this.hidden), inScene(this.neighbours.boxes), !this.showsSurround);
    compositor.draw(renderer, camera, worldFromScene, frontToBack, depth);
    mesh.renderOrder = kFirstRenderOrder + this.neighbours.behind.length;
    mesh.material.uniforms.clipFromScene.value
      .multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse)
      .multiply(worldFromScene);
    mesh.visible = frontToBack.length > 0;
  }

  // The place of the world, in the last picture, at `at` (from -1 to 1 across it, upwards); of the scene alone. Nothing
  // where there is nothing, or what is there hides less than half of what is behind.
  pick(at: THREE.Vector2, renderer: THREE.WebGLRenderer): THREE.Vector3 | undefined {
    if (!this.compositor || this.drawn.length === 0) return undefined;
    const inScene = this.compositor.surfaceAt(renderer, at);
    return inScene?.applyMatrix4(this.localFromScene).applyMatrix4(this.matrixWorld);
  }

  // Gives back all memory, of the card and of the page.
  override dispose(): void {
    super.dispose();
    this.disposed = true;
    this.leaveCard();
    this.pool.dispose();
  }

  private leaveCard(): void {
    this.streamer?.dispose();
    this.compositor?.dispose();
    this.opaque.dispose();
    if (this.mesh) {
      this.remove(this.mesh);
      this.mesh.geometry.dispose();
      this.mesh.material.dispose();
    }
    this.canvas?.removeEventListener('webglcontextlost', this.onContextLost);
    this.streamer = this.compositor = this.mesh = this.canvas = undefined;
  }

  // Milliseconds for uploads: a share of what a picture takes, so that slow machines do not wait for ever; more of them
  // while there is nothing to be seen anyway.
  private uploadTime(): number {
    const now = performance.now();
    const since = now - this.lastUpdate;
    this.lastUpdate = now;
    return Math.min(Math.max(0.2 * since, this.complete ? 3 : 30), 200);
  }

  // What needs to know the graphics card.
  private prepare(renderer: THREE.WebGLRenderer) {
    if (!this.compositor || !this.streamer || !this.mesh) {
      this.compositor = new Compositor(renderer, this.tileset);
      const source = new VolumeSource(this.tree, this.files, this.pool, this.compositor, renderer);
      const pinned = [...coarsestTiles(this.tree), ...(this.tree.surround >= 0 ? [this.tree.surround] : [])];
      this.streamer = new TileStreamer(new TileSelector(this.tree, this.selection), source, pinned, this.stream);
      this.streamer.onError = (error) => this.onError(error);
      this.mesh = cityMesh(this.compositor);
      this.add(this.mesh);
      this.canvas = renderer.domElement;
      this.canvas.addEventListener('webglcontextlost', this.onContextLost);
    }
    return { compositor: this.compositor, streamer: this.streamer, mesh: this.mesh };
  }
}

async function openTileset(files: SceneFiles): Promise<Tileset> {
  const text = new TextDecoder().decode(await files.read('tileset.json', kTilesetBytes));
  const tileset = decodeTileset(text, 'tileset.json');
  if (tileset.representation !== 'volume') {
    throw new SceneError('tileset.json', '', `is a scene of ${tileset.representation}, not of volume`, 'draw it with a viewer that knows it');
  }
  return tileset;
}

// The camera as the selection needs it, in scene units.
function tileView(tileset: Tileset, camera: THREE.Camera, worldFromScene: THREE.Matrix4, size: THREE.Vector2): TileView {
  const sceneFromCamera = worldFromScene.clone().invert().multiply(camera.matrixWorld);
  const projection = camera.projectionMatrix.elements;
  const isParallel = projection[15] === 1;
  // The eye of a parallel projection is so far behind the picture that its rays come from there.
  const behind = isParallel ? 1e7 : 0;
  const eye = new THREE.Vector3()
    .setFromMatrixPosition(sceneFromCamera)
    .addScaledVector(new THREE.Vector3().setFromMatrixColumn(sceneFromCamera, 2).normalize(), behind)
    .toArray();
  const clipFromScene = camera.projectionMatrix.clone().multiply(sceneFromCamera.clone().invert()).elements;
  const row = (i: number): Plane => [clipFromScene[i], clipFromScene[4 + i], clipFromScene[8 + i], clipFromScene[12 + i]];
  const w = row(3);
  const sides = [0, 1].flatMap((i) => {
    const r = row(i);
    return [1, -1].map((sign): Plane => [w[0] + sign * r[0], w[1] + sign * r[1], w[2] + sign * r[2], w[3] + sign * r[3]]);
  });
  // The near and far planes are not asked: rays know neither.
  const planes = isParallel ? sides : [w, ...sides];
  const scale = new THREE.Vector3().setFromMatrixScale(worldFromScene).x;
  const focal = 0.5 * Math.max(projection[0] * size.x, projection[5] * size.y) * (isParallel ? scale : 1);
  return new TileView(eye as unknown as Vec3, planes, focal, size.x * size.y, tileset.near, isParallel);
}
