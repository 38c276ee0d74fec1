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
import { ContentSource } from './content-source';
import { DecodePool } from './decode-pool';
import { cityMesh, kFirstRenderOrder } from './draw/city-mesh';
import { OpaqueDepth } from './draw/opaque-depth';
import { picturesOf, type Picture } from './draw/picture';
import { kFarAway, type DrawnContent, type DrawnPart, type SceneDrawer } from './draw/scene-drawer';
import { tileView } from './picture-view';
import { kCodecs, type KnownRepresentation } from './representations/codecs';
import { drawingOf, type DisplayMode, type KnownDrawing } from './representations/drawers';
import { SceneError } from './scene-error';
import { ServedFiles, type ContentFile, type SceneFiles } from './scene-files';
import { TileSelector, kSelectionSettings, type SelectionSettings } from './stream/tile-selector';
import { boxOfCells, coarsestTiles, cutFrontToBack, tileTree, type TileTree } from './stream/tile-tree';
import { jointView } from './stream/tile-view';
import { kStreamSettings, TileStreamer, type StreamSettings, type StreamStatistics } from './stream/tile-streamer';
import type { Content, Resource } from './tiles/content-codec';
import { decodeTileset } from './tiles/decode-tileset';
import type { Tileset } from './tiles/tileset';

const kTilesetBytes = 1 << 24;
const kNearby = 1e-6; // scene units
const kPrefetchTime = 30; // ms for uploads, while nothing is drawn

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

export type { StreamSettings };
export type KnownTileset = Tileset<KnownRepresentation>;

type Streamer = TileStreamer<ContentFile, Content, DrawnContent, Resource>;

// From where, and what draws it.
interface Look {
  size: THREE.Vector2; // of the pictures, in pixels
  pictures: Picture[];
  worldFromScene: THREE.Matrix4;
  drawer: SceneDrawer;
  streamer: Streamer;
  mesh: ReturnType<typeof cityMesh>;
}

export class TesseraScene extends THREE.Object3D {
  readonly localFromScene = new THREE.Matrix4(); // of this object, from the scene's units
  readonly selection: SelectionSettings;
  readonly stream: StreamSettings;
  resolutionScale = 1; // pixels of the scene beside those of the canvas, along an edge
  largestResolutionScale = 1; // for which room is kept on the card, so that tiles need not go when it is reached
  display: DisplayMode = 'colour';
  featureLevel = 1; // which display modes show that show one: 0, the coarse features, to `featureLevels`
  minTransmittance = 1 / 255; // rays end where less would be seen; 0: never
  // Boxes in which nothing of it is drawn, at most kMostHiddenBoxes: from the cube of edge 1 about the origin to this
  // object's frame.
  hidden: THREE.Matrix4[] = [];
  showsSurround = true; // false: nothing outside of `bounds` is drawn
  // How far one sees beyond `bounds`, in diagonals of these: what lies farther fades into what is behind.
  visibility = Infinity;
  neighbours: Neighbours = { behind: [], boxes: [] };
  // Of tiles that cannot be had, of a budget that is too small, and of a card that cannot draw the scene; told once each.
  onError: (error: SceneError) => void = () => {};
  private readonly tree: TileTree;
  private readonly opaque = new OpaqueDepth();
  private readonly drawing: KnownDrawing;
  private drawer?: SceneDrawer;
  private streamer?: Streamer;
  private mesh?: ReturnType<typeof cityMesh>;
  private drawn: number[] = [];
  private lastUpdate = 0;
  private disposed = false;
  private refused = false; // the card cannot draw it
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
    readonly tileset: KnownTileset,
    readonly files: SceneFiles,
    options: SceneOptions,
    private readonly pool: DecodePool,
  ) {
    super();
    this.name = tileset.name;
    this.selection = { ...kSelectionSettings, ...options.selection };
    this.stream = { ...kStreamSettings, ...options.stream };
    this.tree = tileTree(tileset, 'tileset.json');
    this.drawing = drawingOf(tileset.representation);
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

  // The coarsest level and the surround are there, or cannot be had; on a card that cannot draw it, nothing can.
  get complete(): boolean {
    return this.refused || (this.streamer?.complete ?? false);
  }

  // Nothing that the last view asked for is still to come.
  get idle(): boolean {
    return this.refused || (this.complete && (this.streamer?.idle ?? false) && this.drawer?.wantsAnotherFrame() === false);
  }

  // What `display` may be, and what `featureLevel` may be where a mode shows one.
  get shows(): Pick<KnownDrawing, 'modes' | 'featureLevels'> {
    return this.drawing;
  }

  // The most fine levels of features that any content has which has come so far; 0 where there are none.
  get featureLevels(): number {
    return this.drawer?.featureLevels ?? 0;
  }

  get statistics(): SceneStatistics | undefined {
    if (!this.streamer || !this.drawer) return undefined;
    return { ...this.streamer.statistics, targetBytes: this.drawer.bytes + this.opaque.bytes, drawn: this.drawn };
  }

  // Of an ArrayCamera, and of a headset while it presents, a picture for each of its cameras; all are streamed for at once.
  update(camera: THREE.Camera, renderer: THREE.WebGLRenderer): void {
    const look = this.look(camera, renderer);
    if (!look) return;
    const { size, pictures, worldFromScene, drawer, streamer, mesh } = look;
    const surfaces = this.neighbours.behind.map((scene) => scene.mesh).filter((one) => one !== undefined);
    const depth = this.opaque.draw(renderer, pictures, this, size, new Set(surfaces));
    const { views, tiles, surround } = this.ask(look, this.uploadTime());
    const cut = new Set(tiles.map(({ tile }) => tile));
    const contentOf = new Map(tiles.filter(({ visible }) => visible).map(({ tile, content }) => [tile, content]));
    // What it surrounds comes first: on slow machines a picture of it alone would only take time.
    const behind = streamer.complete && this.showsSurround ? streamer.residentOf(surround) : undefined;
    const contents = views.map((view): DrawnPart[] => {
      const parts = cutFrontToBack(this.tree, cut, view.eye).flatMap((tile): DrawnPart[] => {
        const content = contentOf.get(tile);
        if (content === undefined || !view.sees(this.tree.tiles[tile])) return [];
        return [{ content: streamer.residentOf(content)!, within: tile === content ? undefined : boxOfCells(this.tree, tile) }];
      });
      return behind ? [...parts, { content: behind }] : parts;
    });
    this.drawn = new Array<number>(this.tileset.levels).fill(0);
    for (const content of new Set(contentOf.values())) ++this.drawn[this.tree.tiles[content].level];
    const { low, high } = this.tileset.box;
    const diagonal = Math.hypot(...high.map((x, axis) => x - low[axis]));
    const sceneFromLocal = this.localFromScene.clone().invert();
    const inScene = (boxes: readonly THREE.Matrix4[]) => boxes.map((box) => sceneFromLocal.clone().multiply(box));
    // Rays that meet nothing in whole scenes are the surround's, or else the coarsest content's: always there, whatever is in
    // view.
    const ofNothing = behind ?? streamer.residentOf(coarsestTiles(this.tree)[0]);
    mesh.visible = drawer.draw({ pictures, worldFromScene, contents, opaqueDepth: depth, ofNothing }, {
      minTransmittance: this.minTransmittance,
      visibility: Math.min(Math.max(this.visibility * diagonal, kNearby), kFarAway),
      display: this.display,
      featureLevel: this.featureLevel,
      // Something else may stand behind, though nothing that ends rays does.
      endsRays: this.showsSurround && this.visibility === Infinity && this.neighbours.behind.length === 0,
      hidden: inScene(this.hidden),
      hiddenOfSurround: inScene(this.neighbours.boxes),
      withinBox: !this.showsSurround,
    });
    mesh.renderOrder = kFirstRenderOrder + this.neighbours.behind.length;
  }

  // Streams in what `update` would draw, and draws nothing: for who waits until it is `idle`, and then wants one picture.
  prefetch(camera: THREE.Camera, renderer: THREE.WebGLRenderer): void {
    const look = this.look(camera, renderer);
    if (look) this.ask(look, kPrefetchTime);
  }

  // The place of the world, in the last picture, at `at` (from -1 to 1 across it, upwards); of the scene alone. Nothing
  // where there is nothing, or what is there hides less than half of what is behind. Of several cameras, `eye` is the number
  // of the one whose picture it is.
  pick(at: THREE.Vector2, renderer: THREE.WebGLRenderer, eye = 0): THREE.Vector3 | undefined {
    const picture = this.drawer?.pictures[eye];
    if (!picture) return undefined;
    const inScene = this.drawer!.surfaceAt(renderer, picture, at);
    return inScene?.applyMatrix4(this.localFromScene).applyMatrix4(this.matrixWorld);
  }

  // Gives back all memory, of the card and of the page.
  override dispose(): void {
    super.dispose();
    this.disposed = true;
    this.leaveCard();
    this.pool.dispose();
  }

  // Gives back the memory of the card, and of what was fetched; the next update fetches it anew.
  leaveCard(): void {
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

  // Nothing where nothing can be drawn.
  private look(camera: THREE.Camera, renderer: THREE.WebGLRenderer): Look | undefined {
    if (this.disposed || this.refused || renderer.getContext().isContextLost()) return undefined;
    const prepared = this.prepare(renderer);
    if (!prepared) return undefined;
    this.updateWorldMatrix(true, false);
    camera.updateWorldMatrix(true, false);
    const worldFromScene = this.matrixWorld.clone().multiply(this.localFromScene);
    const { size, pictures } = picturesOf(camera, renderer, worldFromScene, this.resolutionScale);
    return pictures.length === 0 ? undefined : { size, pictures, worldFromScene, ...prepared };
  }

  // What to draw of what is there; and another step of what is on its way.
  private ask({ size, pictures, worldFromScene, drawer, streamer }: Look, uploadFor: number) {
    drawer.resize(size);
    const enlarged = Math.max(1, this.largestResolutionScale / this.resolutionScale) ** 2;
    streamer.settings = { ...this.stream, cardBytes: this.stream.cardBytes - enlarged * (drawer.bytes + this.opaque.bytes) };
    const views = pictures.map((picture) => tileView(this.tileset, picture, worldFromScene));
    return { views, ...streamer.update(jointView(views), uploadFor) };
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
    if (!this.drawer || !this.streamer || !this.mesh) {
      try {
        this.drawer = this.drawing.makeDrawer(renderer, this.tileset);
      } catch (error) {
        if (!(error instanceof SceneError)) throw error;
        this.refused = true;
        this.onError(error);
        return undefined;
      }
      const source = new ContentSource({ tileset: this.tileset, tree: this.tree, files: this.files, pool: this.pool, drawer: this.drawer }, renderer);
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
