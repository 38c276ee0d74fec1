// What draws the contents of one scene: how they come to the graphics card, and the picture that they make together.
// representations/drawers.ts has one for each representation.
import type * as THREE from 'three';
import type { Content, ContentHeader, Resource } from '../tiles/content-codec';
import type { Box, TileContent, Tileset } from '../tiles/tileset';
import type { ShownMode } from './display-modes';
import type { Picture } from './picture';

export const kFarAway = 1e30; // scene units

// A content on the card, or on its way there: its drawer alone knows what stands in it.
export type DrawnContent = object;

// Of a content, the part in a box; all of it where there is none.
export interface DrawnPart<Drawn extends DrawnContent = DrawnContent> {
  content: Drawn;
  within?: Box;
}

// What of a scene decides how it is drawn.
export type DrawnScene = Pick<Tileset, 'box' | 'near' | 'levels'>;

// Where a content stands. `number` and `level` are the tile's, for display modes.
export interface ContentPlace extends Pick<TileContent, 'box' | 'surround'> {
  number: number;
  level: number;
  isDrawnForLong: boolean; // always there, so that what takes long to prepare is worth it
}

export interface DrawSettings {
  minTransmittance: number; // rays end where less would be seen; 0: never
  visibility: number; // how far beyond the scene's box anything is seen, scene units, above 0
  display: string; // of ShownMode
  featureLevel: number; // which such a mode shows
  endsRays: boolean; // rays that end nowhere in scenes that say so are opaque
  // Boxes in which nothing is drawn, and such in which nothing of the surround is: from the cube of edge 1 about the
  // origin to the scene. Those that are flat hide nothing.
  hidden: readonly THREE.Matrix4[];
  hiddenOfSurround: readonly THREE.Matrix4[];
  withinBox: boolean; // nor is anything outside of the scene's box
}

export interface SceneView<Drawn extends DrawnContent = DrawnContent> {
  pictures: Picture[];
  worldFromScene: THREE.Matrix4; // of three's world
  contents: DrawnPart<Drawn>[][]; // of each picture, front to back
  opaqueDepth: THREE.Texture | null; // of what else is opaque; rays end there
  ofNothing?: Drawn; // what rays belong to that meet nothing: always the same, whatever is in view
}

// The last picture, for what shows it (city-mesh.ts).
export interface DrawnPicture {
  readonly pictures: readonly Picture[]; // that are in it
  readonly colour: THREE.Texture; // what the scene adds to each pixel, with its opacity
  readonly distance: THREE.Texture; // how far away it is, and 1 where half of what is behind is hidden
  readonly distancesOfBytes: boolean; // from 0 for no distance to 255 for the farthest
  readonly view: {
    resolution: { value: THREE.Vector2 }; // pixels
    opaqueDepth: { value: THREE.Texture | null };
    display: { value: number }; // of the drawer's modes
  };
}

export interface SceneDrawer<
  Header extends ContentHeader = ContentHeader, Decoded extends Content = Content, Drawn extends DrawnContent = DrawnContent,
> extends DrawnPicture {
  readonly bytes: number; // of the card, without contents
  readonly featureLevels: number; // the most fine levels of any content that has been prepared; 0 where there are none

  // Of the card, once it is there; resources apart.
  residentBytes(header: Header): number;
  // Of the card, while any content is there that needs it; as in memory where this is not said.
  residentBytesOfResource?(resource: Resource): number;
  // Has the driver begin with what is needed to draw such a content, beside other work.
  prepare(header: Header, place: ContentPlace): void;
  // `resources`: those that it was decoded with, the same objects for all contents that share them.
  allocate(content: Decoded, place: ContentPlace, resources: readonly Resource[]): Drawn;
  // Takes the next slice to the card, and says what comes next: another; to wait for the card; or that it can be drawn.
  upload(content: Drawn): 'more' | 'wait' | 'done';
  free(content: Drawn): void;

  resize(size: THREE.Vector2): void;
  // True where there is something to be seen. Throws SceneError where more boxes are hidden than can be.
  draw(view: SceneView<Drawn>, settings: DrawSettings): boolean;
  // Whether the same view drawn again would look otherwise, though nothing that was asked for is still to come.
  wantsAnotherFrame(): boolean;
  // Where the surface is in a picture, scene units; `at` runs from -1 to 1 across it, upwards.
  surfaceAt(renderer: THREE.WebGLRenderer, picture: Picture, at: THREE.Vector2): THREE.Vector3 | undefined;
  dispose(): void;
}

// What there is to choose from where modes show levels of features.
export interface FeatureLevels {
  label: string; // for people
  most: number; // fine ones
  coarse: string; // what level 0 is called
}

// How scenes of a representation are drawn.
export interface SceneDrawing<
  Header extends ContentHeader = ContentHeader, Decoded extends Content = Content, Drawn extends DrawnContent = DrawnContent,
> {
  modes: readonly ShownMode[];
  featureLevels?: FeatureLevels;
  // Throws SceneError where the card cannot draw such a scene.
  makeDrawer(renderer: THREE.WebGLRenderer, scene: DrawnScene): SceneDrawer<Header, Decoded, Drawn>;
}
