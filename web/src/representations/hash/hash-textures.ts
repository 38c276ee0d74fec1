// The textures of a `hash` content on the GPU.
import * as THREE from 'three';
import { kForms } from '../../draw/sliced-textures';
import { atlasUniforms, ContentTextures } from '../../raymarch/content-textures';
import type { Vec3 } from '../../tiles/tileset';
import { countColumns, kLengthOfRow, logitsOfLevel, vectorsOfPart, type ByteRange, type HashContent, type HashPart, type HashSettings, type List } from './hash-content';
import { ratioFor } from './octant-distances';

export const kCornerAtlases = [['corners0First', 'corners0Second'], ['corners1First', 'corners1Second']] as const;

// The indices of the columns or features that two texels of four bytes hold: docs/tile-format.md, section 6.
const kFirst = [1, 2, 3, 0];
const kSecond = [4, 5, 6, 7];

export class HashTextures extends ContentTextures<HashPart> {
  readonly numbers: Float32Array;
  private readonly ofMarch: Record<string, THREE.IUniform>;
  private readonly columns: number;
  private readonly origins: { macroblocks: Vec3[]; distances: Vec3[] };
  private readonly firstRowsByList: { tables: number[]; nearDistances: number[] };

  constructor(content: HashContent) {
    super(content.parts);
    const { settings, corners, atlasDepth, macroblocks, distances, nearDistances, tables } = content;
    this.columns = countColumns(settings);
    this.firstRowsByList = { tables: tables.firstRows, nearDistances: nearDistances.firstRows };
    this.origins = { macroblocks: macroblocks.origins, distances: distances.origins };
    this.ofMarch = {
      ...Object.assign({}, ...corners.map((eight, e) => this.addAtlas(eight, atlasDepth, kCornerAtlases[e]))) as Record<string, THREE.IUniform>,
      ...atlasUniforms(corners[0].size, atlasDepth),
      macroblocks: { value: this.addCubes(macroblocks, kForms.fourBytes) },
      distances: { value: this.addCubes(distances, kForms.wholeWord) },
      nearDistances: { value: this.add(makeListTexture(nearDistances), kForms.wholeWord, nearDistances.words) },
      tables: { value: this.add(makeListTexture(tables), kForms.twoWords, tables.words) },
      levelWeights: { value: levelWeights(settings, this.parts[0].tables.length) },
      stepLength: { value: settings.step },
    };
    this.numbers = new Float32Array(4 * vectorsOfPart(this.columns, this.parts[0].tables.length) * this.parts.length);
    this.orderParts(this.parts.map((_, n) => n));
  }

  uniforms(): Record<string, THREE.IUniform> {
    return this.ofMarch;
  }

  orderParts(order: number[]): void {
    const { macroblocks, distances } = this.origins;
    const vectors = vectorsOfPart(this.columns, this.parts[0].tables.length);
    order.forEach((n, place) => {
      const part = this.parts[n];
      const eights = Array.from({ length: this.columns / 8 }, (_, e) => part.ranges.slice(8 * e, 8 * e + 8));
      this.numbers.set(
        [
          ...part.centre, part.lattice, ...part.scale, part.cells, ...part.low, part.contracted ? 1 : 0,
          ...part.high, Math.log2(ratioFor(part.cells)), ...macroblocks[n], this.firstRowsByList.nearDistances[n], ...distances[n], 0,
          // The GPU normalises these textures to [0, 1]; entries of tables remain bytes.
          ...eights.flatMap((ranges) => rangeVectors(ranges, 1)),
          ...part.tables.flatMap(({ resolution, entries, hashed, ranges }, level) =>
            [resolution, entries, hashed ? 1 : 0, this.firstRowsByList.tables[n * part.tables.length + level], ...rangeVectors(ranges, 255)]),
        ],
        4 * vectors * place,
      );
    });
  }
}

function makeListTexture({ rows, layers }: List): THREE.DataArrayTexture {
  return layers === 0 ? new THREE.DataArrayTexture(null, 1, 1, 1) : new THREE.DataArrayTexture(null, kLengthOfRow, rows, layers);
}

// Returns offsets and factors that map numbers from 0 to `maximum` to the ranges: those of diffuse colour and density,
// then those of features.
function rangeVectors(ranges: ByteRange[], maximum: number): number[] {
  return [kFirst, kSecond].flatMap((columns) => [
    ...columns.map((c) => ranges[c].low), ...columns.map((c) => (ranges[c].high - ranges[c].low) / maximum),
  ]);
}

// Returns the weights of each level for density and for all else, if they are the same everywhere.
function levelWeights({ weights, logits }: HashSettings, tables: number): THREE.Vector2[] {
  const each = logitsOfLevel(weights);
  const weight = (logit: number) => 1 / (1 + Math.exp(-logit));
  return Array.from({ length: tables }, (_, level) => {
    if (each === 0 || !logits) return new THREE.Vector2(1, 1);
    return new THREE.Vector2(weight(logits[each * level]), weight(logits[each * level + each - 1]));
  });
}
