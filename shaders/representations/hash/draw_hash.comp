// Composites one content of `hash` behind the sums of each pixel's ray (docs/tile-format.md, section 7). Contents are
// drawn front to back.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_hash.h"
#include "../../compute/vectors.glsl"
#include "../../render/view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const int TABLES = 2;
KERNEL_ARGUMENTS(DrawHashArguments)

#include "../../lib/domain_path.glsl"
#include "../../raymarch/part_place.glsl"

layout(buffer_reference, std430, buffer_reference_align = 8) buffer Words2Pointer { uvec2 values[]; };
const uint kEmpty = 0xffffffffu;
const float shares[TESSERA_MAX_TABLES + 1] = float[](1, 1, 1, 1, 1, 1, 1, 1, 1);  // of levels; only the browser has display modes
const int attention = 0;

float stepLength, minTransmittance;
vec2 levelWeights[TABLES];
VectorsPointer contentVectors;
#define content contentVectors.values

struct Part {
  Place place;
  float texels, lattice;
  int ratio, ranges;
  UintPointer macroblocks, cornerWords, coarse, fine;
  uint number;
};

Place placeOfPart(uint number) {
  HashPartArguments a = arguments.values.parts.values[number];
  return Place(toVec3(a.centre), toVec3(a.scale), toVec3(a.low), toVec3(a.high), a.contracted != 0);
}

Part fetchPart(uint number) {
  HashPartArguments a = arguments.values.parts.values[number];
  return Part(placeOfPart(number), a.texels, a.lattice, a.ratio, int(a.firstVector), a.macroblocks, a.cornerWords, a.coarse,
              a.fine, number);
}

uint distanceWord(Part part, ivec3 cell) {
  const uint edge = uint(part.texels) >> part.ratio;
  return part.coarse.values[uint(cell.x) + edge * (uint(cell.y) + edge * uint(cell.z))];
}

uint nearWord(Part part, uint n) { return part.fine.values[n]; }

vec4 macroblockAt(Part part, vec3 block) {
  const uint edge = uint(part.lattice) / 8;
  const uint number = part.macroblocks.values[uint(block.x) + edge * (uint(block.y) + edge * uint(block.z))];
  return number == kEmpty ? vec4(0) : vec4(float(number), 0, 0, 1);  // exact: below 2^24
}

vec4 secondOfCorners;  // the second half of the last result of cornersFirst

// The eight columns of a corner are two words, which are read together.
vec4 cornersFirst(Part part, int eight, vec4 macroblock, vec3 within) {
  const vec3 low = min(floor(within), 7.0), share = within - low;
  const uint eights = arguments.values.columns / 8;
  const uint first = uint(macroblock.x) * 729 + uint(low.x) + 9 * (uint(low.y) + 9 * uint(low.z));
  vec4 sum = vec4(0);
  secondOfCorners = vec4(0);
  [[unroll]] for (uint k = 0; k < 8; ++k) {
    const bvec3 upper = bvec3(k & 1, k & 2, k & 4);
    const vec3 w = mix(1 - share, share, upper);
    const uint corner = first + uint(upper.x) + 9 * uint(upper.y) + 81 * uint(upper.z);
    const uvec2 words = Words2Pointer(part.cornerWords).values[eights * corner + eight];
    const float weight = w.x * w.y * w.z;
    sum += weight * unpackUnorm4x8(words.x);
    secondOfCorners += weight * unpackUnorm4x8(words.y);
  }
  return sum.yzwx;
}
vec4 cornersSecond(Part part, int eight, vec4 macroblock, vec3 within) { return secondOfCorners; }

uvec2 entryAt(Part part, int level, float number, uint entry) {
  return Words2Pointer(arguments.values.parts.values[part.number].tables[level]).values[entry];
}

#include "hash_march.glsl"
#include "../../raymarch/march_part.glsl"
#include "../../raymarch/march_parts.glsl"

void main() {
  DrawHashArguments a = arguments.values;
  uint pixel;
  if (!pixelIndex(a.view, pixel)) return;
  const uint first = a.view.numbersOfPixel * pixel;
  const float before = a.view.pixels.values[first];
  const vec3 d = rayDirection(a.view, pixel);
  if (before < a.view.minTransmittance || d == vec3(0)) return;
  stepLength = a.stepLength;
  minTransmittance = a.view.minTransmittance / before;
  contentVectors = a.vectors;
  for (int l = 0; l < TABLES; ++l) levelWeights[l] = vec2(a.levelWeights[2 * l], a.levelWeights[2 * l + 1]);
  const Composite sum = marchContent(a.view, pixel, d, toVec3(a.low), toVec3(a.high), a.partCount, a.isBackgroundBlock != 0);
  if (sum.transmittance >= 1) return;
  storeSurfaceBehind(a.view, pixel, before, sum);
  a.view.pixels.values[first] = before * sum.transmittance;
  a.view.pixels.values[first + 1] += before * sum.depth;
  for (uint c = 0; c < 3; ++c) a.view.pixels.values[first + 2 + c] += before * sum.diffuse[c];
  for (uint c = 0; c < 4; ++c) a.view.pixels.values[first + 5 + c] += before * sum.features[c];
  a.view.pixels.values[first + 9 + a.network] += before * (1 - sum.transmittance);
}
