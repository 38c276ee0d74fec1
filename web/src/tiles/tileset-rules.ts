// The rules for tilesets: docs/tile-format.md, section 3. Each function returns the first violation as text for users.
import type { TilesetRules } from './content-codec';
import {
  boxOfCells,
  cellsIn,
  holdsBox,
  holdsCells,
  type Box,
  type Cells,
  type Matrix4,
  type Tile,
  type Tileset,
} from './tileset';

export type Broken = string | undefined;

export const kFarthestInScene = 1e7; // scene units
const kFarthest = 1e12; // metres
const kMaxLevels = 64;
const kMaxCells = 4096;

function isRotation(r: readonly number[]): boolean {
  const column = (i: number) => r.slice(3 * i, 3 * i + 3);
  const dot = (a: number[], b: number[]) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  for (let i = 0; i < 3; ++i) {
    for (let j = 0; j < 3; ++j) {
      if (!(Math.abs(dot(column(i), column(j)) - (i === j ? 1 : 0)) < 1e-6)) return false;
    }
  }
  const [x, y, z] = [column(0), column(1), column(2)];
  return dot(x, [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]) > 0;
}

function isScale(scale: number): boolean {
  return scale > 1 / kFarthest && scale < kFarthest;
}

function isAffine(m: Matrix4): boolean {
  return m.every((x) => Math.abs(x) <= kFarthest) && m[3] === 0 && m[7] === 0 && m[11] === 0 && m[15] === 1;
}

function isSimilarity(m: Matrix4): boolean {
  if (!isAffine(m)) return false;
  const scale = Math.hypot(m[0], m[1], m[2]);
  return isScale(scale) && isRotation([0, 1, 2].flatMap((c) => [0, 1, 2].map((r) => m[4 * c + r] / scale)));
}

function isBox({ low, high }: Box): boolean {
  return [0, 1, 2].every((a) => low[a] >= -kFarthestInScene && high[a] <= kFarthestInScene && low[a] < high[a]);
}

function isError(metres: number): boolean {
  return metres >= 0 && metres <= kFarthest;
}

function isRange(cells: Cells): boolean {
  return cells.i0 < cells.i1 && cells.j0 < cells.j1;
}

// Along each axis, two tiles cover the same cells or disjoint cells, and no two cover the same cells along both axes.
function lieOnGrid(all: Cells[]): boolean {
  const areApart = (sides: [number, number][]) => {
    sides.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    return sides.every((side, i) => {
      const before = sides[i - 1];
      return i === 0 || (side[0] === before[0] && side[1] === before[1]) || side[0] >= before[1];
    });
  };
  return (
    areApart(all.map((c) => [c.i0, c.i1])) &&
    areApart(all.map((c) => [c.j0, c.j1])) &&
    new Set(all.map((c) => `${c.i0} ${c.j0}`)).size === all.length
  );
}

// A URI consists of segments of letters, digits, '.', '_' and '-', separated by single slashes, none beginning with a
// dot.
export function isPlainUri(uri: string): boolean {
  return uri.length <= 255 && /^[A-Za-z0-9_-][A-Za-z0-9._-]*(\/[A-Za-z0-9_-][A-Za-z0-9._-]*)*$/.test(uri);
}

function ruleOfFrames(tileset: Tileset): Broken {
  const { rotation, scale, translation } = tileset.worldFromScene;
  if (!isRotation(rotation)) return "worldFromScene's rotation is not a rotation";
  if (!isScale(scale)) return "worldFromScene's scale is not above zero";
  if (!translation.every((x) => Math.abs(x) <= kFarthest)) return "worldFromScene's translation is out of bounds";
  if (!isAffine(tileset.sourceFromWorld)) return 'sourceFromWorld is not affine';
  if (![tileset.columns, tileset.rows].every((count) => count >= 1 && count <= kMaxCells)) {
    return "the grid's columns or rows are out of bounds";
  }
  const bottom = tileset.box.low[2];
  const top = tileset.box.high[2];
  if (!(bottom >= -16 && bottom < top && top <= 16)) return "the grid's heights are not within -16 and 16";
  if (!(tileset.near >= 0 && tileset.near <= 1)) return 'near is not between 0 and 1';
  if (!tileset.background.every((x) => x >= 0 && x <= 1)) return 'the background is not a colour';
  const geo = tileset.georeference;
  if (geo) {
    if (!(Math.abs(geo.latitude) <= 90 && Math.abs(geo.longitude) <= 180 && Math.abs(geo.altitude) <= 1e5)) {
      return 'the georeference is not a place on the Earth';
    }
    if (!isSimilarity(geo.enuFromWorld)) return "the georeference's enuFromWorld is not a similarity";
  }
  return undefined;
}

function ruleOfResources(tileset: Tileset): Broken {
  const seen = new Set<string>();
  for (const { uri, mimeType } of tileset.resources) {
    if (!isPlainUri(uri)) return 'the uri of a shared resource is not plain';
    if (seen.has(uri)) return 'a shared resource is listed twice';
    seen.add(uri);
    if (mimeType.length < 1 || mimeType.length > 127) return 'a shared resource has no mimeType';
  }
  return undefined;
}

// Checks the background blocks of the root: finer ones have smaller texels.
function ruleOfBackgroundBlocks(tileset: Tileset): Broken {
  const backgroundBlocks = tileset.tiles[0].contents.filter(({ backgroundBlock }) => backgroundBlock).sort((a, b) => a.level - b.level);
  for (const [i, { box, level, geometricError }] of backgroundBlocks.entries()) {
    if (!holdsBox(box, tileset.box)) return "the background block's box does not contain the scene's";
    if (level >= tileset.levels) return "a background block's level is not below the scene's number of levels";
    if (!isError(geometricError)) return "a background block's geometric error is not a length";
    if (i > 0 && level === backgroundBlocks[i - 1].level) return 'two background blocks have the same level';
    if (i > 0 && geometricError < backgroundBlocks[i - 1].geometricError) return "a background block's geometric error is below a finer one's";
  }
  return undefined;
}

function ruleOfContents(tileset: Tileset, tile: Tile, { overlappingContents }: TilesetRules): Broken {
  const ranges: Cells[] = [];
  for (const content of tile.contents) {
    if (!isPlainUri(content.uri) || !content.uri.endsWith('.glb')) return "a content's uri is not the plain name of a .glb file";
    if (!isBox(content.box)) return "a content's box is empty or out of bounds";
    if (content.resources.some((index) => index >= tileset.resources.length)) {
      return 'a content needs a shared resource that is not listed';
    }
    if (new Set(content.resources).size !== content.resources.length) return 'a content needs a shared resource twice';
    if (content.backgroundBlock) {
      if (tile.parent !== -1) return 'a background block is not in the root';
      continue;
    }
    if (!holdsBox(tile.box, content.box)) return "a content's box is not within its tile's";
    if (!isRange(content.cells) || !holdsCells(tile.cells, content.cells)) return "a content's cells are not within its tile's";
    ranges.push(content.cells);
  }
  if (!overlappingContents && !lieOnGrid(ranges)) return 'contents of a tile have no order';
  return tile.parent === -1 ? ruleOfBackgroundBlocks(tileset) : undefined;
}

// Inner walls must be exact; at the border of the grid a tile may own what lies outside.
function keepsToCells(tileset: Tileset, tile: Tile): boolean {
  const walls = boxOfCells(tileset, tile.cells);
  const { cells, box } = tile;
  return (
    !(cells.i0 > 0 && box.low[0] < walls.low[0]) &&
    !(cells.j0 > 0 && box.low[1] < walls.low[1]) &&
    !(cells.i1 < tileset.columns && box.high[0] > walls.high[0]) &&
    !(cells.j1 < tileset.rows && box.high[1] > walls.high[1])
  );
}

function ruleOfTile(tileset: Tileset, tile: Tile, rules: TilesetRules): Broken {
  if (tile.level >= tileset.levels) return "its level is not below the scene's number of levels";
  const all = { i0: 0, j0: 0, i1: tileset.columns, j1: tileset.rows };
  if (!isRange(tile.cells) || !holdsCells(all, tile.cells)) return 'its cells are not within the grid';
  if (!isBox(tile.box)) return 'its box is empty or out of bounds';
  if (!rules.overlappingContents && !keepsToCells(tileset, tile)) return 'its box is not within its cells';
  if (!isError(tile.geometricError)) return 'its geometric error is not a length';
  return ruleOfContents(tileset, tile, rules);
}

function ruleOfChildren(tileset: Tileset, tile: Tile): Broken {
  const children = tile.children.map((index) => tileset.tiles[index]);
  for (const child of children) {
    if (child.level >= tile.level) return 'a child is not of a finer level';
    if (!holdsCells(tile.cells, child.cells)) return "a child's cells are not within its own";
    if (!holdsBox(tile.box, child.box)) return "a child's box is not within its own";
    if (child.geometricError > tile.geometricError) return "a child's geometric error is above its own";
  }
  if (!lieOnGrid(children.map((child) => child.cells))) return 'its children do not lie on a grid';
  const cells = children.reduce((sum, child) => sum + cellsIn(child.cells), 0);
  if (children.length > 0 && cells !== cellsIn(tile.cells)) return 'its children do not cover its cells';
  return undefined;
}

// Returns the first violated rule; `rules` are the representation's. `tiles` already form a tree, which the reader
// ensures.
export function validationError(tileset: Tileset, rules: TilesetRules): Broken {
  if (tileset.levels < 1 || tileset.levels > kMaxLevels) return 'the number of levels is out of bounds';
  const broken = ruleOfFrames(tileset) ?? ruleOfResources(tileset);
  if (broken) return broken;
  const root = tileset.tiles[0];
  if (!(tileset.geometricError >= root.geometricError && tileset.geometricError <= kFarthest)) {
    return "the tileset's geometric error is below its root's";
  }
  const { i0, j0, i1, j1 } = root.cells;
  if (i0 !== 0 || j0 !== 0 || i1 !== tileset.columns || j1 !== tileset.rows) return 'the root does not cover all cells';
  for (const checkRule of [ruleOfTile, ruleOfChildren]) {
    for (const [index, tile] of tileset.tiles.entries()) {
      const reason = checkRule(tileset, tile, rules);
      if (reason) return `tile ${index}: ${reason}`;
    }
  }
  return undefined;
}
