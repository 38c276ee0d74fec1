// A content of a `hash` scene on the graphics card.
import * as THREE from 'three';
import { atlasUniforms, ContentTextures, kForms } from '../../raymarch/content-textures';
import type { Vec3 } from '../../tiles/tileset';
import { columnsOf, kLengthOfRow, logitsOfLevel, vectorsOfPart, type ByteRange, type HashContent, type HashPart, type HashSettings, type List } from './hash-content';
import { ratioFor } from './octant-distances';

export const kCornerAtlases = [['corners0First', 'corners0Second'], ['corners1First', 'corners1Second']] as const;

// Of the eight columns or features that two texels of four bytes hold: docs/tile-format.md, section 6.
const kFirst = [1, 2, 3, 0];
const kSecond = [4, 5, 6, 7];

export class HashTextures extends ContentTextures<HashPart> {
  readonly numbers: Float32Array;
  private readonly ofMarch: Record<string, THREE.IUniform>;
  private readonly columns: number;
  private readonly origins: { macroblocks: Vec3[]; distances: Vec3[] };
  private readonly rowsOf: { tables: number[]; nearDistances: number[] };

  constructor(content: HashContent) {
    super(content.parts);
    const { settings, corners, atlasDepth, macroblocks, distances, nearDistances, tables } = content;
    this.columns = columnsOf(settings);
    this.rowsOf = { tables: tables.rowOf, nearDistances: nearDistances.rowOf };
    this.origins = { macroblocks: macroblocks.origins, distances: distances.origins };
    this.ofMarch = {
      ...Object.assign({}, ...corners.map((eight, e) => this.addAtlas(eight, atlasDepth, kCornerAtlases[e]))) as Record<string, THREE.IUniform>,
      ...atlasUniforms(corners[0].size, atlasDepth),
      macroblocks: { value: this.addCubes(macroblocks, kForms.fourBytes) },
      distances: { value: this.addCubes(distances, kForms.wholeWord) },
      nearDistances: { value: this.add(textureOf(nearDistances), kForms.wholeWord, nearDistances.words) },
      tables: { value: this.add(textureOf(tables), kForms.twoWords, tables.words) },
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
          ...part.high, Math.log2(ratioFor(part.cells)), ...macroblocks[n], this.rowsOf.nearDistances[n], ...distances[n], 0,
          // What the card has made numbers from 0 to 1 of; entries of tables stay bytes.
          ...eights.flatMap((ranges) => rangeVectors(ranges, 1)),
          ...part.tables.flatMap(({ resolution, entries, hashed, ranges }, level) =>
            [resolution, entries, hashed ? 1 : 0, this.rowsOf.tables[n * part.tables.length + level], ...rangeVectors(ranges, 255)]),
        ],
        4 * vectors * place,
      );
    });
  }
}

function textureOf({ rows, layers }: List): THREE.DataArrayTexture {
  return layers === 0 ? new THREE.DataArrayTexture(null, 1, 1, 1) : new THREE.DataArrayTexture(null, kLengthOfRow, rows, layers);
}

// What is added, and what a number from 0 to `most` is multiplied with: of diffuse colour and density, then of features.
function rangeVectors(ranges: ByteRange[], most: number): number[] {
  return [kFirst, kSecond].flatMap((columns) => [
    ...columns.map((c) => ranges[c].low), ...columns.map((c) => (ranges[c].high - ranges[c].low) / most),
  ]);
}

// Where they are the same everywhere: of density and of all else.
function levelWeights({ weights, logits }: HashSettings, tables: number): THREE.Vector2[] {
  const each = logitsOfLevel(weights);
  const weight = (logit: number) => 1 / (1 + Math.exp(-logit));
  return Array.from({ length: tables }, (_, level) => {
    if (each === 0 || !logits) return new THREE.Vector2(1, 1);
    return new THREE.Vector2(weight(logits[each * level]), weight(logits[each * level + each - 1]));
  });
}
