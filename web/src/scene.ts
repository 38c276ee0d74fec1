// A tessera scene as an object of three.js:
//
//   const city = await TesseraScene.load(url);
//   world.add(city, car);
//   // each frame:
//   city.update(camera, renderer);
//   renderer.render(world, camera);
//
// `update` streams the tiles that the camera needs and renders the scene into render targets of its own, where its rays
// end at the opaque objects of the same world; `render` then composites it with them. The object's frame is the
// capture's, turned from z up to y up, in metres if the capture has a scale. For several scenes in one world, see
// scenes.ts.
import * as THREE from 'three';
import { kYUpFromZUp } from './axes';
import { ContentSource } from './content-source';
import { DecodePool } from './decode-pool';
import { cityMesh, kFirstRenderOrder } from './draw/city-mesh';
import { OpaqueDepth } from './draw/opaque-depth';
import { makePictures, type Picture } from './draw/picture';
import { kFarAway, type DrawnContent, type DrawnPart, type SceneDrawer } from './draw/scene-drawer';
import { tileView } from './picture-view';
import { kCodecs, type KnownRepresentation } from './representations/codecs';
import { getDrawing, type DisplayMode, type KnownDrawing } from './representations/drawers';
import { SceneError } from './scene-error';
import { ServedFiles, type ContentFile, type SceneFiles } from './scene-files';
import { LevelFades, type FadedTile } from './stream/level-fades';
import { TileSelector, kSelectionSettings, type SelectedTile, type SelectionSettings } from './stream/tile-selector';
import { boxOfCells, coarsestTiles, cutFrontToBack, tileTree, type TileTree } from './stream/tile-tree';
import { jointView } from './stream/tile-view';
import { kStreamSettings, TileStreamer, type StreamSettings, type StreamStatistics } from './stream/tile-streamer';
import type { Content, Resource } from './tiles/content-codec';
import { decodeTileset } from './tiles/decode-tileset';
import type { Tileset } from './tiles/tileset';

const kTilesetBytes = 1 << 24;
const kUsualBytesPerPixel = 29; // until there is a drawer
const kDepthBytesPerPixel = 8;
const kNearby = 1e-6; // scene units
const kPrefetchTime = 30; // ms for uploads per call of `prefetch`, which draws nothing

// Both override the defaults, kSelectionSettings and kStreamSettings.
export interface SceneOptions {
  selection?: Partial<SelectionSettings>;
  stream?: Partial<StreamSettings>;
}

export interface SceneStatistics extends StreamStatistics {
  targetBytes: number; // GPU memory of the scene's render targets
  drawn: number[]; // number of tiles of each level in the last frame
}

// The other scenes of the same world, as updateScenes (scenes.ts) sets them.
export interface Neighbours {
  behind: readonly TesseraScene[]; // already drawn in this frame; rays of this scene end at their surfaces
  boxes: readonly THREE.Matrix4[]; // boxes in which the background block is not drawn, in the form of `hidden`
}

export type { StreamSettings };
export type KnownTileset = Tileset<KnownRepresentation>;

type Streamer = TileStreamer<ContentFile, Content, DrawnContent, Resource>;

// What is needed to render the scene from one camera.
interface Look {
  size: THREE.Vector2; // of the render target, in pixels
  pictures: Picture[];
  worldFromScene: THREE.Matrix4;
  drawer: SceneDrawer;
  streamer: Streamer;
  mesh: ReturnType<typeof cityMesh>;
}

export class TesseraScene extends THREE.Object3D {
  readonly localFromScene = new THREE.Matrix4(); // from scene units to this object's frame
  readonly selection: SelectionSettings;
  readonly stream: StreamSettings;
  resolutionScale = 1; // resolution of the scene relative to that of the canvas, along an edge
  largestResolutionScale = 1; // GPU memory is reserved for this resolution, so that reaching it evicts no tiles
  display: DisplayMode = 'colour';
  featureLevel = 1; // the level that `featureLevel` display modes show: 0 for the coarse features, up to `featureLevels`
  framesAtRest = 64; // how many frames are blended where nothing moves, in scenes whose frames are noisy
  antialiases = true; // these frames show different places within the pixels, so that edges are smooth
  minTransmittance = 1 / 255; // rays end below this transmittance; 0: never
  // Boxes in which nothing of the scene is drawn, at most kMaxHiddenBoxes. Each matrix maps the unit cube centred at
  // the origin to this object's frame.
  hidden: THREE.Matrix4[] = [];
  showsBackgroundBlock = true; // false: nothing outside of `bounds` is drawn
  // Visibility range beyond `bounds`, as a multiple of their diagonal: farther parts fade into what is behind.
  visibility = Infinity;
  neighbours: Neighbours = { behind: [], boxes: [] };
  // Called once for each tile that cannot be loaded, for a budget that is too small, and for a GPU that cannot draw the
  // scene.
  onError: (error: SceneError) => void = () => {};
  private readonly tree: TileTree;
  private readonly opaque = new OpaqueDepth();
  private readonly drawing: KnownDrawing;
  private drawer?: SceneDrawer;
  private streamer?: Streamer;
  private mesh?: ReturnType<typeof cityMesh>;
  private readonly fades: LevelFades;
  private drawn: number[] = [];
  private shown = ''; // differs when the scene's own depth may, for the same cameras
  private lastBehind = ''; // `shown` of the scenes behind this one
  private lastUpdate = 0;
  private disposed = false;
  private refused = false; // the GPU cannot draw it
  private canvas?: EventTarget;
  // After a loss of the WebGL context everything is fetched again as soon as there is a context.
  private readonly onContextLost = () => this.leaveGpu();

  // Loads a scene from the address of its folder (or of the tileset.json in it), or from other files. Throws SceneError
  // if there is no scene, or if it is of an unsupported kind, and TypeError if the address is not a valid URL.
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
    readonly tileset: KnownTileset,
    readonly files: SceneFiles,
    options: SceneOptions,
    private readonly pool: DecodePool,
  ) {
    super();
    this.name = tileset.name;
    this.stream = { ...kStreamSettings, ...options.stream };
    this.tree = tileTree(tileset, 'tileset.json');
    this.fades = new LevelFades(this.tree);
    this.drawing = getDrawing(tileset.representation);
    const { hysteresis = kSelectionSettings.hysteresis } = this.drawing;
    this.selection = { ...kSelectionSettings, hysteresis, ...options.selection };
    const { rotation: r, scale, translation: t } = tileset.worldFromScene;
    this.localFromScene.set(
      r[0] * scale, r[3] * scale, r[6] * scale, t[0],
      r[1] * scale, r[4] * scale, r[7] * scale, t[1],
      r[2] * scale, r[5] * scale, r[8] * scale, t[2],
      0, 0, 0, 1);
    this.localFromScene.premultiply(kYUpFromZUp);
  }

  // The bounding box of the captured region, in this object's frame.
  get bounds(): THREE.Box3 {
    const { low, high } = this.tileset.box;
    return new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high)).applyMatrix4(this.localFromScene);
  }

  // The colour behind everything.
  get background(): THREE.Color {
    return new THREE.Color().setRGB(...this.tileset.background, THREE.SRGBColorSpace);
  }

  // True when the coarsest level and the background block are loaded or cannot be loaded, and on a GPU that cannot draw
  // the scene.
  get complete(): boolean {
    return this.refused || (this.streamer?.complete ?? false);
  }

  // True when nothing that the last view requested is still to be loaded.
  get loaded(): boolean {
    return this.refused || (this.complete && (this.streamer?.idle ?? false));
  }

  // True when drawing the same view again would give the same image.
  get idle(): boolean {
    return this.loaded && (this.refused || (this.drawer?.wantsAnotherFrame() === false && !this.fades.isFading));
  }

  // The values that `display` can have, and those that `featureLevel` can have for modes that use it.
  get shows(): Pick<KnownDrawing, 'modes' | 'featureLevels'> {
    return this.drawing;
  }

  // The largest number of fine feature levels of the contents loaded so far; 0 if there are none.
  get featureLevels(): number {
    return this.drawer?.featureLevels ?? 0;
  }

  get statistics(): SceneStatistics | undefined {
    if (!this.streamer || !this.drawer) return undefined;
    return { ...this.streamer.statistics, targetBytes: this.drawer.bytes + this.opaque.bytes, drawn: this.drawn };
  }

  // GPU memory of the scene's render targets, and of the depth of opaque objects.
  get bytesPerPixel(): number {
    return (this.drawer?.bytesPerPixel ?? kUsualBytesPerPixel) + kDepthBytesPerPixel;
  }

  // Streams and draws the scene for a camera. An ArrayCamera, or a headset that presents, gets one view per camera;
  // tiles are requested for all views together.
  update(camera: THREE.Camera, renderer: THREE.WebGLRenderer): void {
    const look = this.look(camera, renderer);
    if (!look) return;
    const { size, pictures, worldFromScene, drawer, streamer, mesh } = look;
    const surfaces = this.neighbours.behind.map((scene) => scene.mesh).filter((one) => one !== undefined);
    const depth = this.opaque.draw(renderer, pictures, this, size, new Set(surfaces));
    const { views, tiles, backgroundBlock } = this.ask(look, this.uploadTime());
    const cut = new Set(tiles.map(({ tile }) => tile));
    const contentByTile = new Map(tiles.filter(({ visible }) => visible).map(({ tile, content }) => [tile, content]));
    // The background block is drawn only once the coarsest tiles are complete: on slow machines a frame of it alone
    // would only take time.
    const behind = streamer.complete && this.showsBackgroundBlock ? streamer.findResident(backgroundBlock) : undefined;
    const pieces = this.fade(tiles, look);
    const contents = views.map((view): DrawnPart[] => {
      const parts = cutFrontToBack(this.tree, cut, view.eye).flatMap((leaf): DrawnPart[] => (pieces.get(leaf) ?? [])
        .filter(({ tile }) => view.sees(this.tree.tiles[tile]))
        .map(({ tile, content, low, high }) => ({
          content: streamer.findResident(content)!, within: tile === content ? undefined : boxOfCells(this.tree, tile),
          share: high - low < 1 ? [low, high] : undefined,
        })));
      return behind ? [...parts, { content: behind }] : parts;
    });
    this.drawn = new Array<number>(this.tileset.levels).fill(0);
    for (const content of new Set(contentByTile.values())) ++this.drawn[this.tree.tiles[content].level];
    const { low, high } = this.tileset.box;
    const diagonal = Math.hypot(...high.map((x, axis) => x - low[axis]));
    const sceneFromLocal = this.localFromScene.clone().invert();
    const inScene = (boxes: readonly THREE.Matrix4[]) => boxes.map((box) => sceneFromLocal.clone().multiply(box));
    // In scenes whose rays always end, rays that hit nothing take the background block's colour, or else the coarsest
    // content's. It is always resident, so the colour does not depend on the view.
    const backgroundContent = behind ?? streamer.findResident(coarsestTiles(this.tree)[0]);
    const behindThis = JSON.stringify(this.neighbours.behind.map(({ shown }) => shown));
    const hasOpaqueDepthChanged = this.opaque.hasChanged || behindThis !== this.lastBehind;
    this.lastBehind = behindThis;
    this.shown = JSON.stringify([
      [...pieces], this.hidden, this.visibility, this.minTransmittance, behind !== undefined, behindThis,
    ]);
    mesh.visible = drawer.draw({ pictures, worldFromScene, contents, opaqueDepth: depth, hasOpaqueDepthChanged, backgroundContent }, {
      minTransmittance: this.minTransmittance,
      visibility: Math.min(Math.max(this.visibility * diagonal, kNearby), kFarAway),
      display: this.display,
      featureLevel: this.featureLevel,
      framesAtRest: this.framesAtRest,
      antialiases: this.antialiases,
      hidesOthers: this.opaque.hidesBehindScene,
      // Something else may be visible behind the scene even if it ends no rays.
      endsRays: this.showsBackgroundBlock && this.visibility === Infinity && this.neighbours.behind.length === 0,
      hidden: inScene(this.hidden),
      hiddenOfBackgroundBlock: inScene(this.neighbours.boxes),
      withinBox: !this.showsBackgroundBlock,
    });
    mesh.renderOrder = kFirstRenderOrder + this.neighbours.behind.length;
  }

  // Streams what `update` would draw, without drawing: for callers that wait until the scene is `loaded` and then need
  // one complete image.
  prefetch(camera: THREE.Camera, renderer: THREE.WebGLRenderer): void {
    const look = this.look(camera, renderer);
    if (look) this.ask(look, kPrefetchTime);
  }

  // Returns the place in the world at `at` (from -1 to 1 across the last image, y upwards), considering this scene
  // alone. Returns undefined if nothing is there, or if less than half of what is behind is hidden. With several
  // cameras, `eye` is the index of the camera.
  pick(at: THREE.Vector2, renderer: THREE.WebGLRenderer, eye = 0): THREE.Vector3 | undefined {
    const picture = this.drawer?.pictures[eye];
    if (!picture) return undefined;
    const inScene = this.drawer!.surfaceAt(renderer, picture, at);
    return inScene?.applyMatrix4(this.localFromScene).applyMatrix4(this.matrixWorld);
  }

  // Frees all memory of the GPU and of the page.
  override dispose(): void {
    super.dispose();
    this.disposed = true;
    this.leaveGpu();
    this.pool.dispose();
  }

  // Frees the GPU memory and everything that was fetched; the next update fetches it again.
  leaveGpu(): void {
    this.fades.reset();
    this.streamer?.dispose();
    this.drawer?.dispose();
    this.opaque.dispose();
    if (this.mesh) {
      this.remove(this.mesh);
      this.mesh.geometry.dispose();
      this.mesh.material.dispose();
    }
    this.canvas?.removeEventListener('webglcontextlost', this.onContextLost);
    this.streamer = this.drawer = this.mesh = this.canvas = undefined;
  }

  // Returns undefined if nothing can be drawn.
  private look(camera: THREE.Camera, renderer: THREE.WebGLRenderer): Look | undefined {
    if (this.disposed || this.refused || renderer.getContext().isContextLost()) return undefined;
    const prepared = this.prepare(renderer);
    if (!prepared) return undefined;
    this.updateWorldMatrix(true, false);
    camera.updateWorldMatrix(true, false);
    const worldFromScene = this.matrixWorld.clone().multiply(this.localFromScene);
    const { size, pictures } = makePictures(camera, renderer, worldFromScene, this.resolutionScale);
    return pictures.length === 0 ? undefined : { size, pictures, worldFromScene, ...prepared };
  }

  // Returns what to draw in each visible tile of a cut.
  private fade(cut: readonly SelectedTile[], { drawer, streamer }: Pick<Look, 'drawer' | 'streamer'>): Map<number, FadedTile[]> {
    if (!drawer.crossFades) this.fades.reset();
    return this.fades.next(cut, (tile) => streamer.findResident(tile) !== undefined);
  }

  // Selects what to draw of the resident tiles, and advances the loading by one step.
  private ask({ size, pictures, worldFromScene, drawer, streamer }: Look, uploadFor: number) {
    drawer.resize(size);
    const enlarged = Math.max(1, this.largestResolutionScale / this.resolutionScale) ** 2;
    streamer.settings = { ...this.stream, gpuBytes: this.stream.gpuBytes - enlarged * (drawer.bytes + this.opaque.bytes) };
    const views = pictures.map((picture) => tileView(this.tileset, picture, worldFromScene));
    return { views, ...streamer.update(jointView(views), uploadFor) };
  }

  // Returns the ms for uploads: a share of the frame time, so that slow machines make progress, and more while nothing
  // is visible yet.
  private uploadTime(): number {
    const now = performance.now();
    const since = now - this.lastUpdate;
    this.lastUpdate = now;
    return Math.min(Math.max(0.2 * since, this.complete ? 3 : 30), 200);
  }

  // Creates what depends on the GPU, if it does not exist yet.
  private prepare(renderer: THREE.WebGLRenderer) {
    if (!this.drawer || !this.streamer || !this.mesh) {
      try {
        this.drawer = this.drawing.makeDrawer(renderer, this.tileset);
      } catch (error) {
        if (!(error instanceof SceneError)) throw error;
        this.refused = true;
        this.onError(error);
        return undefined;
      }
      const { tileset, tree, files, pool, drawer, stream: { gpuBytes } } = this;
      const source = new ContentSource({ tileset, tree, files, pool, drawer, gpuBytes }, renderer);
      this.streamer = new TileStreamer(new TileSelector(this.tree, this.selection), source, this.stream);
      this.streamer.onError = (error) => this.onError(error);
      this.mesh = cityMesh(this.drawer);
      this.add(this.mesh);
      this.canvas = renderer.domElement;
      this.canvas.addEventListener('webglcontextlost', this.onContextLost);
    }
    return { drawer: this.drawer, streamer: this.streamer, mesh: this.mesh };
  }
}

async function openTileset(files: SceneFiles): Promise<KnownTileset> {
  const text = new TextDecoder().decode(await files.read('tileset.json', kTilesetBytes));
  return decodeTileset(text, 'tileset.json', kCodecs);
}
