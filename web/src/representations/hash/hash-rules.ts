// The rules for hash contents: docs/tile-format.md, section 7. Each function returns the first violation as text for
// users.
import { kAttributes } from '../../raymarch/content';
import { ruleOfMacroblocks, ruleOfPlace } from '../../raymarch/content-rules';
import type { Broken } from '../../tiles/tileset-rules';
import { logitsOfLevel, type ByteRange, type HashPart, type HashSettings, type HashTable } from './hash-content';

export const kMaxLattice = 1024; // corners along an axis
export const kMaxOccupancyCells = 1016;
export const kMaxTableResolution = 1 << 16;
export const kMaxTableEntries = 1 << 24;
export const kHashInputs = 23; // of the network
const kLargestFeature = 1e6;
const kLargestLogit = 1e6;
const kShortestStep = 1 / 32768;
const kLongestStep = 0.125;

export function ruleOfSettings({ weights, logits, step }: HashSettings, tables: number): Broken {
  if (!(step >= kShortestStep && step <= kLongestStep)) return 'the step is out of bounds';
  const needed = tables * logitsOfLevel(weights);
  if (logits ? logits.length !== needed : needed > kAttributes) return 'its logits are not those of its tables';
  return logits?.every((logit) => Math.abs(logit) <= kLargestLogit) === false ? 'a logit is out of bounds' : undefined;
}

function areRanges(ranges: ByteRange[]): boolean {
  return ranges.every(({ low, high }) => low >= -kLargestFeature && low <= high && high <= kLargestFeature);
}

function ruleOfTable({ resolution, entries, hashed, ranges }: HashTable): Broken {
  if (resolution < 2) return 'the resolution of a table is out of bounds';
  if (entries < 1) return 'a table has no entries, or too many';
  if (hashed && !Number.isInteger(Math.log2(entries))) return 'the entries of a hashed table are not a power of two';
  if (!hashed && entries < resolution ** 3) return 'a table that is not hashed has fewer entries than points';
  return areRanges(ranges) ? undefined : 'a range is out of bounds';
}

// `tables` is the number of tables of the content's first part.
export function ruleOfPart(part: HashPart, tables: number): Broken {
  if (part.lattice % 8 !== 0 || part.lattice < 1) return 'its lattice is out of bounds';
  if (!areRanges(part.ranges)) return 'a range is out of bounds';
  const broken = ruleOfPlace(part) ?? ruleOfMacroblocks(part, part.lattice);
  if (broken) return broken;
  if (part.tables.length !== tables) return 'parts differ in their number of tables';
  for (const table of part.tables) {
    const ofTable = ruleOfTable(table);
    if (ofTable) return ofTable;
  }
  return part.cells % 8 !== 0 || part.cells < 1 ? 'its occupancy is out of bounds' : undefined;
}
