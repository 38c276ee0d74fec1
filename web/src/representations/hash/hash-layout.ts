// How the parts of a hash content share textures, before anything is allocated for them.
import { count, kAttributes, kMacroblock, kTexturesOfShader } from '../../raymarch/content';
import { atlasOf, stack, type AtlasLayout } from '../../raymarch/content-layout';
import type { TextureLimits } from '../../tiles/content-limits';
import type { Vec3 } from '../../tiles/tileset';
import { kLengthOfRow, kRowsOfLayer, type HashPart, type List } from './hash-content';
import { ratioFor } from './octant-distances';

export type ListLayout = Omit<List, 'words'>;

export interface HashLayout {
  corners: AtlasLayout;
  macroblocks: { size: Vec3; origins: Vec3[] };
  distances: { size: Vec3; origins: Vec3[] };
  nearDistances: ListLayout;
  tables: ListLayout;
  bytes: number; // of all textures
}

const kOthers = 5; // macroblocks, distances (2), tables, what is opaque

// Undefined where the limits do not allow it.
export function layOutHash(parts: HashPart[], columns: number, limits: TextureLimits): HashLayout | undefined {
  const texturesOfAtlas = (2 * columns) / kAttributes;
  const mostAtlases = Math.floor((kTexturesOfShader - kOthers) / texturesOfAtlas);
  const corners = atlasOf(parts.reduce((sum, part) => sum + part.stored, 0), limits.edge3D, mostAtlases);
  const macroblocks = stack(parts.map((part) => part.lattice / kMacroblock), limits.edge3D);
  const distances = stack(parts.map(({ cells }) => cells / ratioFor(cells)), limits.edge3D);
  const nearDistances = listsOf(parts.map(({ cells, nearCells }) => nearCells * ratioFor(cells) ** 3));
  const tables = listsOf(parts.flatMap((part) => part.tables.map(({ entries }) => entries)));
  if (!corners || !macroblocks || !distances || Math.max(tables.layers, nearDistances.layers) > limits.layers) return undefined;
  const bytes =
    4 * texturesOfAtlas * count(corners.size) + 4 * count(macroblocks.size) + 4 * count(distances.size) +
    4 * lengthOf(nearDistances) + kAttributes * lengthOf(tables);
  return { corners, macroblocks, distances, nearDistances, tables, bytes };
}

export function listsOf(lengths: number[]): ListLayout {
  let rows = 0;
  const rowOf = lengths.map((length) => {
    const first = rows;
    rows += Math.ceil(length / kLengthOfRow);
    return first;
  });
  const layers = Math.ceil(rows / kRowsOfLayer);
  return { rows: layers > 1 ? kRowsOfLayer : rows, layers, rowOf };
}

// With what is left over at the ends of rows.
export function lengthOf({ rows, layers }: ListLayout): number {
  return kLengthOfRow * rows * layers;
}
