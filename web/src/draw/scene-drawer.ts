// The interface of a drawer, which uploads the contents of one scene and renders them. representations/drawers.ts lists
// the drawing of each representation.
import type * as THREE from 'three';
import type { Content, ContentHeader, Resource } from '../tiles/content-codec';
import type { Box, TileContent, Tileset } from '../tiles/tileset';
import type { ShownMode } from './display-modes';
import type { Picture } from './picture';

export const kFarAway = 1e30; // scene units

// A content on the GPU, or being uploaded; only its drawer knows its structure.
export type DrawnContent = object;

// The part of a content inside a box, or the whole content without one.
export interface DrawnPart<Drawn extends DrawnContent = DrawnContent> {
  content: Drawn;
  within?: Box;
  share?: readonly [number, number]; // drawn in pixels whose threshold lies in [first, second); undefined: in all
}

// The properties of a scene that its drawing depends on.
export type DrawnScene = Pick<Tileset, 'box' | 'near' | 'levels'>;

// The place of a content in the tree. `number` and `level` are those of the tile, for display modes.
export interface ContentPlace extends Pick<TileContent, 'box' | 'backgroundBlock'> {
  number: number;
  level: number;
  isDrawnForLong: boolean; // resident for the whole session, so that expensive preparation pays off
}

export interface DrawSettings {
  minTransmittance: number; // rays end below this transmittance; 0: never
  visibility: number; // visibility range beyond the scene's box, scene units, above 0
  display: string; // name of a ShownMode
  featureLevel: number; // the level that a feature-level mode shows
  framesAtRest: number; // how many frames are blended where nothing moves, if the drawer blends frames
  antialiases: boolean; // these frames show different places within the pixels
  hidesOthers: boolean; // something is drawn after the scene that its surface may hide
  endsRays: boolean; // rays that hit nothing are opaque, in scenes that declare so
  // Boxes in which nothing is drawn, and boxes in which nothing of the background block is drawn. Each matrix maps the
  // unit cube centred at the origin to the scene. Degenerate boxes hide nothing.
  hidden: readonly THREE.Matrix4[];
  hiddenOfBackgroundBlock: readonly THREE.Matrix4[];
  withinBox: boolean; // nothing outside the scene's box is drawn
}

export interface SceneView<Drawn extends DrawnContent = DrawnContent> {
  pictures: Picture[];
  worldFromScene: THREE.Matrix4; // the world of three.js
  contents: DrawnPart<Drawn>[][]; // for each picture, front to back
  opaqueDepth: THREE.Texture | null; // depth of the opaque objects, where rays end
  hasOpaqueDepthChanged: boolean; // since the last frame, although the cameras may not have moved
  backgroundContent?: Drawn; // the content that rays which hit nothing belong to; independent of the view
}

// The rendered image, as the mesh that shows it (city-mesh.ts) needs it.
export interface DrawnPicture {
  readonly pictures: readonly Picture[]; // the pictures that the image contains
  readonly colour: THREE.Texture; // premultiplied colour and opacity of the scene
  readonly distance: THREE.Texture; // distance to the surface, with alpha 1 where half of what is behind is hidden
  readonly distancesOfBytes: boolean; // distances are stored as bytes, from 0 for distance 0 to 255 for infinity
  readonly view: {
    resolution: { value: THREE.Vector2 }; // pixels
    opaqueDepth: { value: THREE.Texture | null };
    display: { value: number }; // index in the drawer's modes
  };
}

export interface SceneDrawer<
  Header extends ContentHeader = ContentHeader, Decoded extends Content = Content, Drawn extends DrawnContent = DrawnContent,
> extends DrawnPicture {
  readonly bytes: number; // GPU memory without contents
  readonly bytesPerPixel: number; // of its targets
  readonly crossFades?: boolean; // whether it honours DrawnPart.share
  readonly featureLevels: number; // largest number of fine levels of the contents prepared so far; 0 if there are none

  // Returns the GPU bytes of a content once it is resident, without resources.
  residentBytes(header: Header): number;
  // Returns the GPU bytes of a resource while any content that needs it is resident. If undefined, they equal its
  // memory size.
  residentBytesOfResource?(resource: Resource): number;
  // Lets the driver start to compile what such a content needs, in the background.
  prepare(header: Header, place: ContentPlace): void;
  // `resources` are those that the content was decoded with: the same objects for all contents that share them.
  allocate(content: Decoded, place: ContentPlace, resources: readonly Resource[]): Drawn;
  // Uploads the next slice to the GPU. Returns 'more' if another slice follows, 'wait' while the GPU is busy, and
  // 'done' when the content can be drawn.
  upload(content: Drawn): 'more' | 'wait' | 'done';
  free(content: Drawn): void;

  resize(size: THREE.Vector2): void;
  // Returns true if anything is visible. Throws SceneError if too many boxes are hidden.
  draw(view: SceneView<Drawn>, settings: DrawSettings): boolean;
  // Returns whether drawing the same view again would give another image, although everything requested is loaded.
  wantsAnotherFrame(): boolean;
  // Returns the surface at a point of a picture, in scene units; `at` runs from -1 to 1 across it, y upwards.
  surfaceAt(renderer: THREE.WebGLRenderer, picture: Picture, at: THREE.Vector2): THREE.Vector3 | undefined;
  dispose(): void;
}

// The choices of modes that show feature levels.
export interface FeatureLevels {
  label: string; // for users
  maximum: number; // largest number of fine levels
  coarse: string; // the name of level 0
}

// How scenes of a representation are drawn.
export interface SceneDrawing<
  Header extends ContentHeader = ContentHeader, Decoded extends Content = Content, Drawn extends DrawnContent = DrawnContent,
> {
  modes: readonly ShownMode[];
  featureLevels?: FeatureLevels;
  hysteresis?: number; // the default of SelectionSettings.hysteresis, if it is another one
  // Throws SceneError if the GPU cannot draw such a scene.
  makeDrawer(renderer: THREE.WebGLRenderer, scene: DrawnScene): SceneDrawer<Header, Decoded, Drawn>;
}
