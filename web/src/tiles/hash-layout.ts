// How the parts of a hash content share textures, before anything is allocated for them.
import { count, kAttributes, kMacroblock, kTexturesOfShader, type TextureLimits } from './content';
import { atlasOf, stack, type AtlasLayout } from './content-layout';
import { distanceLevel, kEntriesOfRow, kRowsOfLayer, type EntryList, type HashPart } from './hash-content';
import type { Vec3 } from './tileset';

export interface HashLayout {
  corners: AtlasLayout;
  macroblocks: { size: Vec3; origins: Vec3[] };
  distances: { size: Vec3; origins: Vec3[] };
  occupied: { size: Vec3; origins: Vec3[] };
  tables: Omit<EntryList, 'words'>;
  bytes: number; // of all textures
}

const kOthers = 5; // macroblocks, distances, occupied, tables, what is opaque

// Undefined where the limits do not allow it.
export function layOutHash(parts: HashPart[], columns: number, limits: TextureLimits): HashLayout | undefined {
  const texturesOfAtlas = (2 * columns) / kAttributes;
  const mostAtlases = Math.floor((kTexturesOfShader - kOthers) / texturesOfAtlas);
  const corners = atlasOf(parts.reduce((sum, part) => sum + part.stored, 0), limits.edge3D, mostAtlases);
  const macroblocks = stack(parts.map((part) => part.lattice / kMacroblock), limits.edge3D);
  const distances = stack(parts.map((part) => part.cells / 2 ** distanceLevel(part.cells)), limits.edge3D);
  const occupied = stack(parts.map((part) => part.cells / 2), limits.edge3D);
  const tables = listOf(parts);
  if (!corners || !macroblocks || !distances || !occupied || tables.layers > limits.layers) return undefined;
  const bytes =
    4 * texturesOfAtlas * count(corners.size) + 4 * count(macroblocks.size) + 4 * count(distances.size) + count(occupied.size) +
    kAttributes * kEntriesOfRow * tables.rows * tables.layers;
  return { corners, macroblocks, distances, occupied, tables, bytes };
}

function listOf(parts: HashPart[]): Omit<EntryList, 'words'> {
  let rows = 0;
  const rowOf = parts.map((part) =>
    part.tables.map(({ entries }) => {
      const first = rows;
      rows += Math.ceil(entries / kEntriesOfRow);
      return first;
    }));
  const layers = Math.ceil(rows / kRowsOfLayer);
  return { rows: layers > 1 ? kRowsOfLayer : rows, layers, rowOf };
}
