// A scene as a tree of tiles: the contents of tileset.json in memory. docs/tile-format.md, section 3, is normative.
//
// Frames: `scene` has z up, and its unit is half the edge of a finest block; `world` is that of the capture; `tile` is
// that of the boxes in tileset.json: metres east, north and up if the scene is georeferenced, otherwise the same as
// `world`.

export type Vec3 = readonly [number, number, number];
export type Matrix4 = readonly number[]; // 16 numbers, column-major

export interface Box {
  low: Vec3;
  high: Vec3;
}

// Cells of the block grid: columns i0 up to but excluding i1, rows j0 up to but excluding j1.
export interface Cells {
  i0: number;
  j0: number;
  i1: number;
  j1: number;
}

export interface TileContent {
  uri: string; // relative to the folder of tileset.json
  cells: Cells;
  box: Box; // scene units
  backgroundBlock: boolean;
  resources: number[]; // indices into Tileset.resources
  bytes: number; // size of the file; 0 if unknown; a hint
  // Level and geometric error (metres) of a background block. Its texels are smallest at the scene's box, where the
  // error applies.
  level: number;
  geometricError: number;
}

export interface Tile {
  level: number; // 0 is the finest
  cells: Cells;
  box: Box;
  geometricError: number; // metres
  parent: number; // -1 for the root
  children: number[]; // indices into Tileset.tiles, each after its parent
  contents: TileContent[];
}

export interface Georeference {
  latitude: number; // degrees, WGS 84
  longitude: number;
  altitude: number; // metres above the ellipsoid, or above the sea if the photos' GPS altitudes are
  enuFromWorld: Matrix4; // a similarity
}

// A file that several contents share.
export interface SharedResource {
  uri: string; // relative to the folder of tileset.json
  mimeType: string;
  bytes: number; // size of the file; 0 if unknown; a hint
}

export interface Tileset<Representation extends string = string> {
  representation: Representation;
  name: string;
  worldFromScene: { rotation: readonly number[]; scale: number; translation: Vec3 }; // rotation: columns
  sourceFromWorld: Matrix4;
  georeference?: Georeference;
  columns: number;
  rows: number;
  box: Box; // of the scene; what lies outside belongs to the background block
  near: number; // scene units: samples must not lie nearer to a camera
  background: Vec3;
  levels: number;
  geometricError: number;
  resources: SharedResource[];
  tiles: Tile[]; // the root first
}

export function cellsIn(cells: Cells): number {
  return (cells.i1 - cells.i0) * (cells.j1 - cells.j0);
}

export function holdsCells(outer: Cells, inner: Cells): boolean {
  return outer.i0 <= inner.i0 && outer.j0 <= inner.j0 && inner.i1 <= outer.i1 && inner.j1 <= outer.j1;
}

export function holdsBox(outer: Box, inner: Box): boolean {
  return [0, 1, 2].every((a) => outer.low[a] <= inner.low[a] && inner.high[a] <= outer.high[a]);
}

// Cell (i, j) covers x in [2i - columns, 2i + 2 - columns]; y is analogous with rows.
export function boxOfCells(tileset: Pick<Tileset, 'columns' | 'rows' | 'box'>, cells: Cells): Box {
  const { columns, rows, box } = tileset;
  return {
    low: [2 * cells.i0 - columns, 2 * cells.j0 - rows, box.low[2]],
    high: [2 * cells.i1 - columns, 2 * cells.j1 - rows, box.high[2]],
  };
}

// Returns the column-major matrix from the scene to the frame of the boxes in tileset.json.
export function tileFromScene(tileset: Tileset): number[] {
  const { rotation, scale, translation } = tileset.worldFromScene;
  const world = [
    ...rotation.slice(0, 3).map((x) => x * scale), 0,
    ...rotation.slice(3, 6).map((x) => x * scale), 0,
    ...rotation.slice(6, 9).map((x) => x * scale), 0,
    ...translation, 1,
  ];
  return tileset.georeference ? multiply(tileset.georeference.enuFromWorld, world) : world;
}

function multiply(a: Matrix4, b: Matrix4): number[] {
  const product = new Array<number>(16).fill(0);
  for (let column = 0; column < 4; ++column) {
    for (let row = 0; row < 4; ++row) {
      for (let k = 0; k < 4; ++k) product[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    }
  }
  return product;
}

// Returns the metres per scene unit (world units if the capture has no scale).
export function metresPerUnit(tileset: Tileset): number {
  const matrix = tileFromScene(tileset);
  return Math.hypot(matrix[0], matrix[1], matrix[2]);
}

// Returns the numbers of a 3D Tiles bounding box: its centre, and its half-edges along the scene's axes.
export function boundingBoxNumbers(tileset: Tileset, box: Box): number[] {
  const m = tileFromScene(tileset);
  const centre = [0, 1, 2].map((row) =>
    [0, 1, 2].reduce((sum, k) => sum + m[4 * k + row] * 0.5 * (box.low[k] + box.high[k]), m[12 + row]),
  );
  const half = (axis: number) => 0.5 * (box.high[axis] - box.low[axis]);
  return [...centre, ...[0, 1, 2].flatMap((axis) => [0, 1, 2].map((row) => m[4 * axis + row] * half(axis)))];
}
