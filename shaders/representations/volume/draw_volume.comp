// Composites one content of `volume` behind the sums of each pixel's ray (docs/tile-format.md, section 6). Contents are
// drawn front to back.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_volume.h"
#include "../../compute/vectors.glsl"
#include "../../render/view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = 0) const uint kMaxWidth = 34;  // the maximum width of the network's layers
KERNEL_ARGUMENTS(DrawVolumeArguments)

#include "../../lib/trigonometry.glsl"
#include "../../render/dense_network.glsl"
#include "../../lib/domain_path.glsl"
#include "../../raymarch/part_place.glsl"

const uint kEmpty = 0xffffffffu;

float featureRange, densityRange, stepsPerTexel, minTransmittance;

struct Part {
  Place place;
  float texels, voxels;
  UintPointer macroblocks, voxelWords, distances;
  uint number;
};

Place placeOfPart(uint number) {
  VolumePartArguments a = arguments.values.parts.values[number];
  return Place(toVec3(a.centre), toVec3(a.scale), toVec3(a.low), toVec3(a.high), a.contracted != 0);
}

Part fetchPart(uint number) {
  VolumePartArguments a = arguments.values.parts.values[number];
  return Part(placeOfPart(number), a.texels, a.voxels, a.macroblocks, a.voxelWords, a.distances, number);
}

uint cellIndex(vec3 cell, float edge) {
  const uvec3 c = uvec3(cell);
  return c.x + uint(edge) * (c.y + uint(edge) * c.z);
}

float reachAt(Part part, vec3 cell) {
  const uint i = cellIndex(cell, part.texels / 8);
  return float(part.distances.values[i / 4] >> 8 * (i % 4) & 255);
}

vec4 macroblockAt(Part part, vec3 block) {
  const uint number = part.macroblocks.values[cellIndex(block, part.voxels / 8)];
  return number == kEmpty ? vec4(0) : vec4(float(number), 0, 0, 1);  // exact: below 2^24
}

// Interpolates the voxels' words: word 0 holds density and diffuse colour, word 1 features.
vec4 mixVoxels(Part part, vec4 macroblock, vec3 within, uint word) {
  const vec3 low = min(floor(within), 7.0), share = within - low;
  const uint first = uint(macroblock.x) * 729 + uint(low.x) + 9 * (uint(low.y) + 9 * uint(low.z));
  vec4 sum = vec4(0);
  for (uint k = 0; k < 8; ++k) {
    const bvec3 upper = bvec3(k & 1, k & 2, k & 4);
    const vec3 w = mix(1 - share, share, upper);
    const uint texel = first + uint(upper.x) + 9 * uint(upper.y) + 81 * uint(upper.z);
    sum += w.x * w.y * w.z * unpackUnorm4x8(part.voxelWords.values[2 * texel + word]);
  }
  return sum;
}

vec4 voxelsFirst(Part part, vec4 macroblock, vec3 within) { return mixVoxels(part, macroblock, within, 0).yzwx; }
vec4 voxelsSecond(Part part, vec4 macroblock, vec3 within) { return mixVoxels(part, macroblock, within, 1); }

vec4 mixPlane(UintPointer words, float texels, vec2 x, uint word) {
  const vec2 u = clamp(x - 0.5, 0, texels - 1), low = min(floor(u), texels - 2), share = u - low;
  const uint edge = uint(texels), first = uint(low.x) + edge * uint(low.y);
  const vec4 a = unpackUnorm4x8(words.values[2 * first + word]), b = unpackUnorm4x8(words.values[2 * first + 2 + word]);
  const uint next = first + edge;
  const vec4 c = unpackUnorm4x8(words.values[2 * next + word]), d = unpackUnorm4x8(words.values[2 * next + 2 + word]);
  return mix(mix(a, b, share.x), mix(c, d, share.x), share.y);
}

vec4 mixPlanes(Part part, vec3 x, uint word) {
  UintPointer planes[3] = arguments.values.parts.values[part.number].planeWords;
  return mixPlane(planes[0], part.texels, x.yz, word) + mixPlane(planes[1], part.texels, x.xz, word) +
         mixPlane(planes[2], part.texels, x.xy, word);
}

vec4 planesFirst(Part part, vec3 x) { return mixPlanes(part, x, 0).yzwx; }
vec4 planesSecond(Part part, vec3 x) { return mixPlanes(part, x, 1); }

#include "volume_march.glsl"
#include "../../raymarch/march_part.glsl"
#include "../../raymarch/march_parts.glsl"

// Returns the specular colour that the network computes from a ray's sums and its direction.
vec3 evaluateSpecular(DrawVolumeArguments a, Composite sum, vec3 d) {
  float values[kMaxWidth];
  for (uint i = 0; i < 3; ++i) values[i] = sum.diffuse[i];
  for (uint i = 0; i < 4; ++i) values[3 + i] = sum.features[i];
  for (uint axis = 0; axis < 3; ++axis) {
    values[7 + axis] = d[axis];
    const vec2 wave = sineAndCosine(d[axis]);
    float sine = wave.x, cosine = wave.y;
    for (uint k = 0; k < 4; ++k) {
      values[10 + 3 * k + axis] = sine;
      values[22 + 3 * k + axis] = cosine;
      const float twice = 2 * sine * cosine;
      cosine = 1 - 2 * sine * sine;
      sine = twice;
    }
  }
  runNetwork(a.layers, a.layerCount, a.weights, values);
  return 1 / (1 + exp(-vec3(values[0], values[1], values[2])));
}

void main() {
  DrawVolumeArguments a = arguments.values;
  uint pixel;
  if (!pixelIndex(a.view, pixel)) return;
  const uint first = a.view.numbersOfPixel * pixel;
  const float before = a.view.pixels.values[first];
  const vec3 d = rayDirection(a.view, pixel);
  if (before < a.view.minTransmittance || d == vec3(0)) return;
  featureRange = a.featureRange;
  densityRange = a.densityRange;
  stepsPerTexel = a.stepsPerTexel;
  minTransmittance = a.view.minTransmittance / before;
  const Composite sum = marchContent(a.view, pixel, d, toVec3(a.low), toVec3(a.high), a.partCount, a.isBackgroundBlock != 0);
  const float opacity = 1 - sum.transmittance;
  if (opacity <= 0) return;
  const vec3 colour = sum.diffuse + opacity * evaluateSpecular(a, sum, d);
  storeSurfaceBehind(a.view, pixel, before, sum);
  a.view.pixels.values[first] = before * sum.transmittance;
  a.view.pixels.values[first + 1] += before * sum.depth;
  for (uint c = 0; c < 3; ++c) a.view.pixels.values[first + 2 + c] += before * colour[c];
}
