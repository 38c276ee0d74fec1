// The tiles of a scene as the renderer needs them: boxes, geometric errors and drawing order. Lengths are in scene
// units. Counterpart of src/render/tile_tree.h.
import { SceneError } from '../scene-error';
import { metresPerUnit, type Box, type Cells, type TileContent, type Tileset, type Vec3 } from '../tiles/tileset';

export interface TileNode {
  parent: number;
  children: number[];
  cells: Cells;
  low: Vec3; // bounding box
  high: Vec3;
  geometricError: number; // of its content: the size of a plane texel
  level: number; // 0 is the finest
  content?: TileContent; // undefined if the children's contents represent it; a leaf without content is empty
  isBackgroundBlock: boolean; // represents what lies outside its box, which is the scene's
}

export interface TileTree {
  columns: number;
  rows: number;
  tiles: TileNode[]; // indexed as in the tileset, the root first, followed by the background blocks, the coarsest first
  backgroundBlock: number; // index of the coarsest background block; the only child of each is the next finer one; -1 if there is none
}

// Throws SceneError if a tile has several contents, which the format allows and this viewer does not draw.
export function tileTree(tileset: Tileset, file: string): TileTree {
  const metres = metresPerUnit(tileset);
  const tiles = tileset.tiles.map((tile, index): TileNode => {
    const contents = tile.contents.filter((content) => !content.backgroundBlock);
    if (contents.length > 1) {
      throw new SceneError(file, `tile ${index}`, 'has several contents, which this viewer does not draw', 'give each a tile of its own');
    }
    const { parent, children, cells, box, level } = tile;
    return {
      parent, children, cells, low: box.low, high: box.high, level,
      geometricError: tile.geometricError / metres, content: contents[0], isBackgroundBlock: false,
    };
  });
  const backgroundBlocks = tileset.tiles[0].contents.filter((content) => content.backgroundBlock).sort((a, b) => b.level - a.level);
  const first = tiles.length;
  backgroundBlocks.forEach((content, i) =>
    tiles.push({
      parent: i === 0 ? -1 : first + i - 1, children: i + 1 < backgroundBlocks.length ? [first + i + 1] : [],
      cells: content.cells, low: tileset.box.low, high: tileset.box.high, level: content.level,
      geometricError: content.geometricError / metres, content, isBackgroundBlock: true,
    }),
  );
  return { columns: tileset.columns, rows: tileset.rows, tiles, backgroundBlock: backgroundBlocks.length > 0 ? first : -1 };
}

function cellAt(x: number, count: number): number {
  return Math.min(Math.max(Math.floor(0.5 * (x + count)), 0), count - 1);
}

function cellsBetween(cell: number, first: number, end: number): number {
  return Math.max(0, first - cell, cell - end + 1);
}

// Returns the children in an order that is front to back along every ray from `eye`: by the number of cells between
// theirs and that of the eye, summed over both axes, which increases along any ray.
export function childrenFrontToBack(tree: TileTree, tile: number, eye: Vec3): number[] {
  const i = cellAt(eye[0], tree.columns);
  const j = cellAt(eye[1], tree.rows);
  const distance = (child: number) => {
    const { i0, i1, j0, j1 } = tree.tiles[child].cells;
    return cellsBetween(i, i0, i1) + cellsBetween(j, j0, j1);
  };
  return [...tree.tiles[tile].children].sort((a, b) => distance(a) - distance(b) || a - b);
}

// Sorts tiles of a cut, or ancestors of them, front to back along every ray from `eye`.
export function cutFrontToBack(tree: TileTree, cut: ReadonlySet<number>, eye: Vec3, from = 0): number[] {
  return cut.has(from) ? [from] : childrenFrontToBack(tree, from, eye).flatMap((child) => cutFrontToBack(tree, cut, eye, child));
}

// Returns the topmost tiles that have contents, without the background block: they cover the whole scene and are always
// resident.
export function coarsestTiles(tree: TileTree): number[] {
  const coarsest: number[] = [];
  const covered: boolean[] = [];
  tree.tiles.forEach((tile, index) => {
    if (tile.isBackgroundBlock) return;
    const above = tile.parent >= 0 && covered[tile.parent];
    if (tile.content && !above) coarsest.push(index);
    covered[index] = above || tile.content !== undefined;
  });
  return coarsest;
}

// Returns the box in which a content is drawn for a tile's cells: unbounded in height, and unbounded outwards at the
// border of the scene.
export function boxOfCells({ columns, rows, tiles }: TileTree, tile: number): Box {
  const { i0, i1, j0, j1 } = tiles[tile].cells;
  const far = 1e9;
  return {
    low: [i0 === 0 ? -far : 2 * i0 - columns, j0 === 0 ? -far : 2 * j0 - rows, -far],
    high: [i1 === columns ? far : 2 * i1 - columns, j1 === rows ? far : 2 * j1 - rows, far],
  };
}
