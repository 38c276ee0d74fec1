// Decodes hash contents. The bytes are untrusted. docs/tile-format.md, sections 5, 7 and 11.
import { count, emptyTextures, kAttributes, putCube, type ContentPart, type Cubes, type MarchedHeader } from '../../raymarch/content';
import { countTextures } from '../../raymarch/content-layout';
import { mismatchWithTileset, ruleOfParts } from '../../raymarch/content-rules';
import { PartReader } from '../../raymarch/part-reader';
import { sizeOfList, takeList } from '../../raymarch/texel-pictures';
import type { ContentCodec, DeclaredContent } from '../../tiles/content-codec';
import { kContentLimits, type ContentLimits } from '../../tiles/content-limits';
import { getArray, getField, getBoolean, numberFrom, getNumber, getString, getInteger, type Json } from '../../tiles/json-fields';
import { ruleOfNetwork, type DenseLayer } from '../../tiles/network';
import {
  countColumns, kLengthOfRow, kLevelWeights, kMaxTables, vectorsOfHash, type ByteRange, type HashContent,
  type HashPart, type HashSettings, type HashTable, type LevelWeights,
} from './hash-content';
import { layOutHash, paddedLength, type HashLayout } from './hash-layout';
import * as rules from './hash-rules';
import { octantDistances, ratioFor } from './octant-distances';

// The header of a content; nothing has been allocated for its texels.
export interface HashHeader extends MarchedHeader {
  settings: HashSettings;
  parts: HashPart[];
  layout: HashLayout;
  atlases: number; // textures that the corner atlas is split into
  sources: Json[]; // JSON of the parts
  network: DenseLayer[];
  views: Uint8Array[];
}

// readHashHeader and decodeHash throw SceneError that names `name` and the first violated rule; `declared` is what
// tileset.json declares about the content. The image decoder must be prepared (lossless-image.ts).
export function readHashHeader(
  file: Uint8Array, name: string, declared?: DeclaredContent, limits = kContentLimits,
): HashHeader {
  return new HashReader(name, limits).readHeader(file, declared);
}

export function decodeHash(header: HashHeader, name: string): HashContent {
  return new HashReader(name, kContentLimits).readTexels(header);
}

export const hashCodec: ContentCodec<HashHeader, HashContent> = {
  readHeader: readHashHeader,
  decode: decodeHash,
  listBuffers({ corners, macroblocks, distances, nearDistances, tables }) {
    const arrays = [
      ...corners.flatMap(({ first, second }) => [first, second]), macroblocks.texels, distances.texels, nearDistances.words, tables.words,
    ];
    return arrays.map(({ buffer }) => buffer as ArrayBuffer);
  },
};

class HashReader extends PartReader {
  constructor(name: string, limits: ContentLimits) {
    super(name, limits);
  }

  readHeader(file: Uint8Array, declared?: DeclaredContent): HashHeader {
    const { ours, views } = this.readFile(file, 'hash');
    const settings = this.readSettings(ours);
    const columns = countColumns(settings);
    const sources = this.readPartSources(ours);
    const parts = sources.map((source, i) => readPart(source, columns, this.readPlace(source)) ?? this.fail(`part ${i}: its header is not complete`));
    const network = this.readNetwork(getField(ours, 'network'), views);
    const tables = parts[0].tables.length;
    const broken =
      rules.ruleOfSettings(settings, tables) ?? ruleOfNetwork(network, rules.kHashInputs) ??
      ruleOfParts(parts, (part) => rules.ruleOfPart(part, tables)) ?? (declared && mismatchWithTileset(parts, declared));
    if (broken) this.fail(broken);
    const layout = this.laidOut(layOutHash(parts, columns, this.limits), 16 * vectorsOfHash({ parts, settings }));
    const atlases = countTextures(layout.corners);
    return { memoryBytes: layout.bytes, settings, parts, layout, atlases, sources, network, views };
  }

  readTexels(header: HashHeader): HashContent {
    const { settings, parts, layout, atlases, network, views } = header;
    const corners = Array.from({ length: countColumns(settings) / kAttributes }, () => emptyTextures(layout.corners.size));
    const macroblocks: Cubes<Uint8Array> = { ...layout.macroblocks, texels: new Uint8Array(4 * count(layout.macroblocks.size)) };
    const distances: Cubes<Uint32Array> = { ...layout.distances, texels: new Uint32Array(count(layout.distances.size)) };
    const near = new Uint32Array(paddedLength(layout.nearDistances));
    const bytes = new Uint8Array(kAttributes * paddedLength(layout.tables));
    let begin = 0; // index of the part's first macroblock in the atlas
    parts.forEach((part, n) => {
      const source = header.sources[n];
      const of = (what: string) => `part ${n}: its ${what} are malformed`;
      const { blocks } = layout.corners;
      if (!this.readMacroblocks(views, source, part.lattice, part.stored, blocks, begin, macroblocks, n, corners)) {
        this.fail(of('macroblocks'));
      }
      begin += part.stored;
      part.tables.forEach(({ entries }, level) => {
        const first = kLengthOfRow * layout.tables.firstRows[n * part.tables.length + level];
        const pictures = getField(getArray(source, 'tables')![level], 'texels');
        const taken = this.takePictures(views, pictures, sizeOfList(entries),
          (pixels, which) => takeList(pixels, which, entries, bytes, first));
        if (!taken) this.fail(of('tables'));
      });
      const bits = this.readBits(views, getField(source, 'occupied'), part.cells);
      const distanceField = bits && octantDistances(bits, part.nearCells);
      if (!distanceField) this.fail(of('occupied cells'));
      putCube(distanceField.coarse, distanceField.edge, distances, n);
      near.set(distanceField.fine, kLengthOfRow * layout.nearDistances.firstRows[n]);
    });
    return {
      settings, network, parts, corners, atlases, atlasDepth: layout.corners.depth, macroblocks, distances,
      nearDistances: { ...layout.nearDistances, words: near },
      tables: { ...layout.tables, words: new Uint32Array(bytes.buffer) },
    };
  }

  private readSettings(ours: Json): HashSettings {
    const weights = getString(ours, 'weights') as LevelWeights;
    const step = getNumber(ours, 'step');
    if (getField(ours, 'whole') !== undefined) this.fail('the key whole is called learned_background now');
    const hasLearnedBackground = getBoolean(ours, 'learned_background');
    if (!kLevelWeights.includes(weights) || step === undefined || hasLearnedBackground === undefined) {
      this.fail('weights, step or learned_background is missing or malformed');
    }
    const settings: HashSettings = { weights, step: Math.fround(step), hasLearnedBackground };
    if (getField(ours, 'logits') === undefined) return settings;
    const logits = getArray(ours, 'logits') ?? [];
    if (logits.length < 1 || logits.length > 2 * kMaxTables) this.fail('its logits are not a list, or their number is out of bounds');
    settings.logits = logits.map((logit) => Math.fround(numberFrom(logit) ?? this.fail('a logit is not a number')));
    return settings;
  }
}

// Returns undefined if a field is missing.
function readPart(source: Json, columns: number, place: ContentPart | undefined): HashPart | undefined {
  const lattice = getInteger(source, 'lattice', rules.kMaxLattice);
  const cells = getInteger(source, 'cells', rules.kMaxOccupancyCells);
  const nearCells = readNearCells(source, cells ?? 0);
  const ranges = readRanges(source, columns);
  const sources = getArray(source, 'tables') ?? [];
  if (!place || lattice === undefined || cells === undefined || nearCells === undefined || !ranges) return undefined;
  if (sources.length < 1 || sources.length > kMaxTables) return undefined;
  const tables = sources.map(readTable);
  return tables.includes(undefined) ? undefined : { ...place, lattice, cells, nearCells, ranges, tables: tables as HashTable[] };
}

function readNearCells(source: Json, cells: number): number | undefined {
  const ratio = ratioFor(cells);
  return ratio === 1 ? 0 : getInteger(source, 'nearCells', Math.floor(cells / ratio) ** 3);
}

function readTable(source: Json): HashTable | undefined {
  const resolution = getInteger(source, 'resolution', rules.kMaxTableResolution);
  const entries = getInteger(source, 'entries', rules.kMaxTableEntries);
  const hashed = getBoolean(source, 'hashed');
  const ranges = readRanges(source, kAttributes);
  if (resolution === undefined || entries === undefined || hashed === undefined || !ranges) return undefined;
  return { resolution, entries, hashed, ranges };
}

function readRanges(source: Json, count: number): ByteRange[] | undefined {
  const pairs = getArray(source, 'ranges');
  if (pairs?.length !== count) return undefined;
  const ranges = pairs.map((pair) => {
    const [low, high] = Array.isArray(pair) && pair.length === 2 ? pair.map(numberFrom) : [];
    return low === undefined || high === undefined ? undefined : { low: Math.fround(low), high: Math.fround(high) };
  });
  return ranges.includes(undefined) ? undefined : (ranges as ByteRange[]);
}

