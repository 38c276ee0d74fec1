// The tiles of a scene as a renderer needs them: where they are, how coarse, in which order. Lengths in scene units.
// Twin of src/render/tile_tree.h.
import { SceneError } from '../scene-error';
import { metresPerUnit, type Box, type Cells, type TileContent, type Tileset, type Vec3 } from '../tiles/tileset';

export interface TileNode {
  parent: number;
  children: number[];
  cells: Cells;
  low: Vec3; // box
  high: Vec3;
  geometricError: number; // of its content: a texel of the planes
  level: number; // 0 is the finest
  content?: TileContent; // none: its children's stand for it; a leaf is empty
  isSurround: boolean; // stands for what is outside of its box, the scene's
}

export interface TileTree {
  columns: number;
  rows: number;
  tiles: TileNode[]; // numbered as the tileset's, the root first; then surrounds, the coarsest first
  surround: number; // the coarsest of them, each with the next finer one as its only child; -1 where there is none
}

// Throws SceneError where a tile has several contents, which the format allows and this viewer does not draw.
export function tileTree(tileset: Tileset, file: string): TileTree {
  const metres = metresPerUnit(tileset);
  const tiles = tileset.tiles.map((tile, index): TileNode => {
    const contents = tile.contents.filter((content) => !content.surround);
    if (contents.length > 1) {
      throw new SceneError(file, `tile ${index}`, 'has several contents, which this viewer does not draw', 'give each a tile of its own');
    }
    const { parent, children, cells, box, level } = tile;
    return {
      parent, children, cells, low: box.low, high: box.high, level,
      geometricError: tile.geometricError / metres, content: contents[0], isSurround: false,
    };
  });
  const surrounds = tileset.tiles[0].contents.filter((content) => content.surround).sort((a, b) => b.level - a.level);
  const first = tiles.length;
  surrounds.forEach((content, i) =>
    tiles.push({
      parent: i === 0 ? -1 : first + i - 1, children: i + 1 < surrounds.length ? [first + i + 1] : [],
      cells: content.cells, low: tileset.box.low, high: tileset.box.high, level: content.level,
      geometricError: content.geometricError / metres, content, isSurround: true,
    }),
  );
  return { columns: tileset.columns, rows: tileset.rows, tiles, surround: surrounds.length > 0 ? first : -1 };
}

function cellAt(x: number, count: number): number {
  return Math.min(Math.max(Math.floor(0.5 * (x + count)), 0), count - 1);
}

function cellsBetween(cell: number, first: number, end: number): number {
  return Math.max(0, first - cell, cell - end + 1);
}

// In an order that is front to back for every ray from `eye`: by the number of cells between theirs and the eye's, along
// both axes together, which grows along any ray.
export function childrenFrontToBack(tree: TileTree, tile: number, eye: Vec3): number[] {
  const i = cellAt(eye[0], tree.columns);
  const j = cellAt(eye[1], tree.rows);
  const distance = (child: number) => {
    const { i0, i1, j0, j1 } = tree.tiles[child].cells;
    return cellsBetween(i, i0, i1) + cellsBetween(j, j0, j1);
  };
  return [...tree.tiles[tile].children].sort((a, b) => distance(a) - distance(b) || a - b);
}

// Tiles of a cut, from one of its tiles or one above them on, front to back for every ray from `eye`.
export function cutFrontToBack(tree: TileTree, cut: ReadonlySet<number>, eye: Vec3, from = 0): number[] {
  return cut.has(from) ? [from] : childrenFrontToBack(tree, from, eye).flatMap((child) => cutFrontToBack(tree, cut, eye, child));
}

// The topmost contents, the surround apart: they cover all that the scene covers, and always stay in memory.
export function coarsestTiles(tree: TileTree): number[] {
  const found: number[] = [];
  const covered: boolean[] = [];
  tree.tiles.forEach((tile, index) => {
    if (tile.isSurround) return;
    const above = tile.parent >= 0 && covered[tile.parent];
    if (tile.content && !above) found.push(index);
    covered[index] = above || tile.content !== undefined;
  });
  return found;
}

// What is drawn of a content in a tile's cells: to its height, and beyond the scene's box at the border.
export function boxOfCells({ columns, rows, tiles }: TileTree, tile: number): Box {
  const { i0, i1, j0, j1 } = tiles[tile].cells;
  const far = 1e9;
  return {
    low: [i0 === 0 ? -far : 2 * i0 - columns, j0 === 0 ? -far : 2 * j0 - rows, -far],
    high: [i1 === columns ? far : 2 * i1 - columns, j1 === rows ? far : 2 * j1 - rows, far],
  };
}
