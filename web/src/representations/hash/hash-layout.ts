// Lays out the parts of a hash content in shared textures, before anything is allocated for them.
import { count, kAttributes, kMacroblock, kTexturesOfShader } from '../../raymarch/content';
import { layOutAtlas, stack, type AtlasLayout } from '../../raymarch/content-layout';
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

const kOthers = 5; // texture units: macroblocks, distances (2), tables, opaque depth

// Returns undefined if the limits do not allow a layout.
export function layOutHash(parts: HashPart[], columns: number, limits: TextureLimits): HashLayout | undefined {
  const texturesOfAtlas = (2 * columns) / kAttributes;
  const maxAtlases = Math.floor((kTexturesOfShader - kOthers) / texturesOfAtlas);
  const corners = layOutAtlas(parts.reduce((sum, part) => sum + part.stored, 0), limits.edge3D, maxAtlases);
  const macroblocks = stack(parts.map((part) => part.lattice / kMacroblock), limits.edge3D);
  const distances = stack(parts.map(({ cells }) => cells / ratioFor(cells)), limits.edge3D);
  const nearDistances = layOutLists(parts.map(({ cells, nearCells }) => nearCells * ratioFor(cells) ** 3));
  const tables = layOutLists(parts.flatMap((part) => part.tables.map(({ entries }) => entries)));
  if (!corners || !macroblocks || !distances || Math.max(tables.layers, nearDistances.layers) > limits.layers) return undefined;
  const bytes =
    4 * texturesOfAtlas * count(corners.size) + 4 * count(macroblocks.size) + 4 * count(distances.size) +
    4 * paddedLength(nearDistances) + kAttributes * paddedLength(tables);
  return { corners, macroblocks, distances, nearDistances, tables, bytes };
}

export function layOutLists(lengths: number[]): ListLayout {
  let rows = 0;
  const firstRows = lengths.map((length) => {
    const first = rows;
    rows += Math.ceil(length / kLengthOfRow);
    return first;
  });
  const layers = Math.ceil(rows / kRowsOfLayer);
  return { rows: layers > 1 ? kRowsOfLayer : rows, layers, firstRows };
}

// Includes the padding at the ends of rows.
export function paddedLength({ rows, layers }: ListLayout): number {
  return kLengthOfRow * rows * layers;
}
