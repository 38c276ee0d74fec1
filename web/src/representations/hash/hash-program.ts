// The part of the content shader that is specific to `hash` scenes: their march. It writes sums, which network-pass.ts
// converts to colours after all contents have been drawn (docs/tile-format.md, section 7).
import marchSource from '../../../../shaders/representations/hash/hash_march.glsl?raw';
import { kAttributes } from '../../raymarch/content';
import type { ProgramPieces } from '../../raymarch/content-program';
import { atlasShader } from '../../raymarch/content-textures';
import { countColumns, kMaxTables, vectorsOfHash, vectorsOfPart, type HashPart, type HashSettings } from './hash-content';
import { kCornerAtlases } from './hash-textures';

// The number of networks that one picture can distinguish depends on the number of weight targets.
export const kWeightsOfTarget = 3; // weights in a target besides its opacity
export function countNetworks(weightTargets: number): number {
  return kWeightsOfTarget * (1 + weightTargets);
}

// The attachments are: the sum of diffuse colour; the distance; the sums of three features (with the opacity that
// remains after fading in the distance; sums themselves must not be faded, as the colour is not linear in them); the
// sum of the fourth feature and the weights of networks 1 and 2; and the weights of three networks in each additional
// one. The weight of network 0 is the rest of the opacity.
function outputs(weightTargets: number): string {
  const more = [...Array(weightTargets).keys()];
  return [
    'layout(location = 0) out vec4 diffuseAndOpacity;',
    'layout(location = 2) out vec4 featuresAndOpacity;',
    'layout(location = 3) out vec4 weightsAndOpacity;',
    ...more.map((n) => `layout(location = ${4 + n}) out vec4 weights${n}AndOpacity;`),
    'uniform int network;  // the content\'s',
    'vec3 weightMask(int first) {',
    '  return vec3(equal(ivec3(first, first + 1, first + 2), ivec3(network)));',
    '}',
    'void writeWeights(float feature, float opacity) {',
    '  weightsAndOpacity = vec4(feature, opacity * weightMask(1).xy, opacity);',
    ...more.map((n) => `  weights${n}AndOpacity = opacity * vec4(weightMask(${kWeightsOfTarget * (n + 1)}), 1.0);`),
    '}',
  ].join('\n');
}

const kUniforms = `
uniform sampler3D macroblocks;
uniform usampler3D distances;
uniform usampler2DArray nearDistances, tables;
uniform vec2 levelWeights[TABLES];
uniform float shares[${kMaxTables + 1}], stepLength;
uniform int attention;
`;

// `content` begins with VECTORS_OF_PART vectors per part; lists have 2048 items in a row and 2048 rows in a layer; the
// numbers in macroblocks are places in an atlas, as bytes.
function partsShader(varying: boolean): string {
  const columns = (half: string) => [
    `vec4 corners${half}(Part part, int eight, vec4 macroblock, vec3 within) {`,
    '  vec3 x = floor(macroblock.xyz * 255.0 + 0.5) * 9.0 + within + 0.5;',
    varying ? `  return eight == 0 ? corners0${half}(x) : corners1${half}(x);` : `  return corners0${half}(x);`,
    '}',
  ].join('\n');
  return `
struct Part {
  Place place;
  float texels, lattice;
  int ratio;
  ivec3 macroblockOrigin, distanceOrigin;
  uint nearRow;  // of its first near distance
  int ranges;
};

Part fetchPart(int n) {
  int at = VECTORS_OF_PART * n;
  vec4 a = content[at], b = content[at + 1], c = content[at + 2], d = content[at + 3], e = content[at + 4], f = content[at + 5];
  return Part(unpackPlace(a, b, c, d), b.w, a.w, int(d.w), ivec3(e.xyz), ivec3(f.xyz), uint(e.w), at + 6);
}

// Returns the texel of item n of a list that begins at firstRow.
ivec3 placeInList(uint firstRow, uint n) {
  uint row = firstRow + (n >> 11);
  return ivec3(n & 2047u, row & 2047u, row >> 11);
}

uint distanceWord(Part part, ivec3 cell) {
  return texelFetch(distances, part.distanceOrigin + cell, 0).r;
}

uint nearWord(Part part, uint n) {
  return texelFetch(nearDistances, placeInList(part.nearRow, n), 0).r;
}

vec4 macroblockAt(Part part, vec3 block) {
  return texelFetch(macroblocks, part.macroblockOrigin + ivec3(block), 0);
}

uvec2 entryAt(Part part, int level, float firstRow, uint entry) {
  return texelFetch(tables, placeInList(uint(firstRow), entry), 0).rg;
}

${columns('First')}

${columns('Second')}
`;
}

const kWrite = `
void writeContent(Composite sum, vec3 d, float opacity, float seen) {
  vec4 features = sum.features;
  if (display == kShowBlocks) features.rgb = opacity * colourOfBlock;
  if (display == kShowLevels) features.rgb = opacity * colourOfLevel;
  const float maximum = 60000.0;  // half floats end at 65504
  diffuseAndOpacity = vec4(clamp(sum.diffuse, -maximum, maximum), opacity);
  features = clamp(features, -maximum, maximum);
  featuresAndOpacity = vec4(features.xyz, seen * opacity);
  writeWeights(features.w, opacity);
}`;

export function hashPieces(
  { parts, settings, atlases }: { parts: HashPart[]; settings: HashSettings; atlases: number }, weightTargets: number,
): ProgramPieces {
  const columns = countColumns(settings);
  const tables = parts[0].tables.length;
  const defines: Record<string, number | string> = { TABLES: tables, VECTORS_OF_PART: vectorsOfPart(columns, tables) };
  if (columns > kAttributes) defines.VARYING = '';
  if (settings.weights === 'shared') defines.SHARED = '';
  const names = kCornerAtlases.slice(0, columns / kAttributes).flat();
  const source = [outputs(weightTargets), kUniforms, atlasShader(names, atlases), partsShader(columns > kAttributes), marchSource, kWrite].join('\n');
  return { parts: parts.length, vectors: vectorsOfHash({ parts, settings }), defines, source };
}
