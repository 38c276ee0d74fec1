// Reads tileset.json, which is untrusted text.
import { SceneError } from '../scene-error';
import type { TilesetRules } from './content-codec';
import { getArray, getField, getBoolean, getNumber, getNumbers, getString, wholeFrom, getInteger, type Json } from './json-fields';
import { boundingBoxNumbers, type Box, type Cells, type Tile, type TileContent, type Tileset, type Vec3 } from './tileset';
import { validationError } from './tileset-rules';

export const kSceneVersion = 1;

export interface TilesetLimits {
  textLength: number;
  tiles: number;
  depth: number;
  contentsOfTile: number;
  resources: number;
}

const kLimits: TilesetLimits = { textLength: 1 << 24, tiles: 65536, depth: 64, contentsOfTile: 64, resources: 65536 };

// Reads the tileset of a scene of one of the representations that are `known`. Throws SceneError that names `file` and
// the first violated rule.
export function decodeTileset<Representation extends string>(
  text: string, file: string, known: Readonly<Record<Representation, TilesetRules>>, limits = kLimits,
): Tileset<Representation> {
  return new TilesetReader(file, known, limits).read(text);
}

function tesseraExtension(object: Json): Json {
  return getField(getField(object, 'extensions'), 'TESSERA_scene');
}

function readBox(object: Json): Box | undefined {
  const low = getNumbers(object, 'low', 3);
  const high = getNumbers(object, 'high', 3);
  return low && high ? { low: low as unknown as Vec3, high: high as unknown as Vec3 } : undefined;
}

function readCells(object: Json): Cells | undefined {
  const cells = getArray(object, 'cells');
  if (cells?.length !== 4 || !cells.every((cell) => wholeFrom(cell) !== undefined)) return undefined;
  const [i0, j0, i1, j1] = cells as number[];
  return { i0, j0, i1, j1 };
}

// Sizes are hints; a value that is not a number counts as unknown.
function getByteCount(object: Json): number {
  return getInteger(object, 'bytes', Number.MAX_SAFE_INTEGER) ?? 0;
}

class TilesetReader<Representation extends string> {
  private readonly sources: Json[] = []; // JSON of each tile

  constructor(
    private readonly file: string,
    private readonly known: Readonly<Record<Representation, TilesetRules>>,
    private readonly limits: TilesetLimits,
  ) {}

  read(text: string): Tileset<Representation> {
    if (text.length > this.limits.textLength) this.fail('is larger than any tileset should be');
    let file: Json;
    try {
      file = JSON.parse(text);
    } catch {
      this.fail('is not JSON');
    }
    this.readAsset(file);
    const tileset = this.readScene(file);
    this.readTree(this.needed(getField(file, 'root'), 'has no root'), tileset);
    const broken = validationError(tileset, this.known[tileset.representation]);
    if (broken) this.fail(broken);
    tileset.tiles.forEach((tile, index) => this.checkBoxes(tileset, tile, index));
    return tileset;
  }

  private fail(reason: string, place = '', remedy = 'copy the scene again, or bake it again'): never {
    throw new SceneError(this.file, place, reason, remedy);
  }

  private needed<T>(value: T | undefined, reason: string, place?: string): NonNullable<T> {
    return value === undefined || value === null ? this.fail(reason, place) : value;
  }

  private readAsset(file: Json): void {
    if (getString(getField(file, 'asset'), 'version') !== '1.1') this.fail('is not 3D Tiles 1.1');
    const required = getField(file, 'extensionsRequired');
    if (required !== undefined && !(Array.isArray(required) && required.length === 0)) {
      this.fail('requires extensions that are not known');
    }
    const ours = this.needed(tesseraExtension(file), 'has no extension TESSERA_scene');
    const version = this.needed(getInteger(ours, 'version'), 'does not state its version');
    if (version !== kSceneVersion) this.fail(`has version ${version}; only ${kSceneVersion} is supported`);
  }

  private readScene(file: Json): Tileset<Representation> {
    const ours = tesseraExtension(file);
    const representation = this.readRepresentation(ours);
    const placement = getField(ours, 'worldFromScene');
    const noPlace = 'worldFromScene or sourceFromWorld lacks numbers';
    const grid = getField(ours, 'grid');
    const incomplete = 'the grid, levels, near or background is not complete';
    const tileset: Tileset<Representation> = {
      representation,
      name: getString(ours, 'name') ?? '',
      worldFromScene: {
        rotation: this.needed(getNumbers(placement, 'rotation', 9), noPlace),
        scale: this.needed(getNumber(placement, 'scale'), noPlace),
        translation: this.needed(getNumbers(placement, 'translation', 3), noPlace) as unknown as Vec3,
      },
      sourceFromWorld: this.needed(getNumbers(ours, 'sourceFromWorld', 16), noPlace),
      columns: this.needed(getInteger(grid, 'columns'), incomplete),
      rows: this.needed(getInteger(grid, 'rows'), incomplete),
      box: this.needed(readBox(grid), incomplete),
      near: this.needed(getNumber(ours, 'near'), incomplete),
      background: this.needed(getNumbers(ours, 'background', 3), incomplete) as unknown as Vec3,
      levels: this.needed(getInteger(ours, 'levels'), incomplete),
      geometricError: this.needed(getNumber(file, 'geometricError'), 'has no geometricError'),
      resources: this.readResources(ours),
      tiles: [],
    };
    const { low, high } = tileset.box;
    const { columns, rows } = tileset;
    if (low[0] !== -columns || low[1] !== -rows || high[0] !== columns || high[1] !== rows) {
      this.fail("the grid's box is not that of its cells");
    }
    const geo = getField(ours, 'georeference');
    if (geo !== undefined) {
      const lacks = 'the georeference lacks numbers';
      tileset.georeference = {
        latitude: this.needed(getNumber(geo, 'latitude'), lacks),
        longitude: this.needed(getNumber(geo, 'longitude'), lacks),
        altitude: this.needed(getNumber(geo, 'altitude'), lacks),
        enuFromWorld: this.needed(getNumbers(geo, 'enuFromWorld', 16), lacks),
      };
    }
    return tileset;
  }

  private readRepresentation(ours: Json): Representation {
    const name = getString(ours, 'representation') ?? this.fail('has no representation');
    if (Object.hasOwn(this.known, name)) return name as Representation;
    const others = Object.keys(this.known).join(' or ');
    return this.fail(`has no representation that is known: it is a scene of ${name.slice(0, 32)}, not of ${others}`, '', 'open it with a viewer that supports it');
  }

  private readResources(ours: Json): Tileset['resources'] {
    const resources = getField(ours, 'resources');
    if (resources === undefined) return [];
    if (!Array.isArray(resources) || resources.length > this.limits.resources) this.fail('has too many shared resources');
    return resources.map((resource) => ({
      uri: this.needed(getString(resource, 'uri'), 'a shared resource has no uri'),
      mimeType: this.needed(getString(resource, 'mimeType'), 'a shared resource has no mimeType'),
      bytes: getByteCount(resource),
    }));
  }

  // Reads level by level, so that deep nesting cannot overflow the stack.
  private readTree(root: Json, tileset: Tileset): void {
    const waiting: { source: Json; depth: number; parent: number }[] = [{ source: root, depth: 0, parent: -1 }];
    for (let index = 0; index < waiting.length; ++index) {
      const { source, depth, parent } = waiting[index];
      const place = `tile ${index}`;
      if (depth >= this.limits.depth) this.fail('the tree is too deep', place);
      const tile = this.readTile(source, parent, place);
      tile.contents = this.readContents(source, tile, place);
      const children = getField(source, 'children') ?? [];
      if (!Array.isArray(children)) this.fail('its children are not a list', place);
      if (children.length > this.limits.tiles - waiting.length) this.fail('has too many tiles');
      for (const child of children) {
        tile.children.push(waiting.length);
        waiting.push({ source: child, depth: depth + 1, parent: index });
      }
      tileset.tiles.push(tile);
      this.sources.push(source);
    }
  }

  private readTile(source: Json, parent: number, place: string): Tile {
    const ours = this.needed(tesseraExtension(source), 'has no extension TESSERA_scene', place);
    const refine = getField(source, 'refine');
    if (refine !== 'REPLACE' && (parent === -1 || refine !== undefined)) this.fail('is not refined by REPLACE', place);
    if (parent !== -1 && getField(source, 'transform') !== undefined) {
      this.fail('only the root may have a transform', place);
    }
    const missing = 'its level, cells, box or geometricError is missing';
    return {
      level: this.needed(getInteger(ours, 'level'), missing, place),
      cells: this.needed(readCells(ours), missing, place),
      box: this.needed(readBox(ours), missing, place),
      geometricError: this.needed(getNumber(source, 'geometricError'), missing, place),
      parent,
      children: [],
      contents: [],
    };
  }

  private readContents(source: Json, tile: Tile, place: string): TileContent[] {
    const one = getField(source, 'content');
    const several = getField(source, 'contents');
    if (one !== undefined && several !== undefined) this.fail('has both content and contents', place);
    if (one !== undefined) return [this.readContent(one, tile, place)];
    if (several === undefined) return [];
    if (!Array.isArray(several) || several.length > this.limits.contentsOfTile) this.fail('has too many contents', place);
    return several.map((content) => this.readContent(content, tile, place));
  }

  private readContent(source: Json, tile: Tile, place: string): TileContent {
    const ours = tesseraExtension(source);
    const missing = 'a content has no uri or no box';
    const resources = getField(ours, 'resources') ?? [];
    if (!Array.isArray(resources) || !resources.every((index) => wholeFrom(index) !== undefined)) {
      this.fail("a content's resources are not a list of numbers", place);
    }
    if (getField(ours, 'surround') !== undefined) this.fail('the key surround is called background_block now', place);
    const backgroundBlock = getBoolean(ours, 'background_block') ?? false;
    const ofBackgroundBlock = (key: string, read: (object: Json, key: string) => number | undefined) =>
      backgroundBlock && getField(ours, key) !== undefined ? this.needed(read(ours, key), "a background block's level or geometric error is not valid", place) : 0;
    return {
      uri: this.needed(getString(source, 'uri'), missing, place),
      box: this.needed(readBox(ours), missing, place),
      cells:
        getField(ours, 'cells') === undefined ? tile.cells : this.needed(readCells(ours), "a content's cells are malformed", place),
      backgroundBlock,
      resources: resources as number[],
      bytes: getByteCount(ours),
      level: ofBackgroundBlock('level', getInteger),
      geometricError: ofBackgroundBlock('geometricError', getNumber),
    };
  }

  // The bounding volumes that other programs cull with must equal ours, up to rounding.
  private checkBoxes(tileset: Tileset, tile: Tile, index: number): void {
    const place = `tile ${index}`;
    const source = this.sources[index];
    const all = [tile.box, ...tile.contents.map((content) => content.box)];
    const enclosing: Box = {
      low: [0, 1, 2].map((a) => Math.min(...all.map((box) => box.low[a]))) as unknown as Vec3,
      high: [0, 1, 2].map((a) => Math.max(...all.map((box) => box.high[a]))) as unknown as Vec3,
    };
    if (!agrees(tileset, source, enclosing)) this.fail('its boundingVolume is not its box', place);
    tile.contents.forEach((content, i) => {
      const entry = getField(source, 'content') ?? getArray(source, 'contents')![i];
      if (getField(entry, 'boundingVolume') !== undefined && !agrees(tileset, entry, content.box)) {
        this.fail("a content's boundingVolume is not its box", place);
      }
    });
  }
}

function agrees(tileset: Tileset, source: Json, box: Box): boolean {
  const given = getNumbers(getField(source, 'boundingVolume'), 'box', 12);
  const expected = boundingBoxNumbers(tileset, box);
  const slack = 1e-6 * Math.max(...expected.map(Math.abs));
  return given !== undefined && given.every((number, i) => Math.abs(number - expected[i]) <= slack);
}
