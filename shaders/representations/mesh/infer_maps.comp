// One invocation per block of 4×4 texels of a part: evaluates the encoder at its texels and compresses them, as
// src/representations/mesh/content/infer_maps.cpp does.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"
#include "../../compute/hash_grid_cells.glsl"

layout(local_size_x = 32) in;
layout(constant_id = 0) const uint kMaxWidth = 64;  // the maximum width of the network's layers
KERNEL_ARGUMENTS(InferMapsArguments)

#include "../../render/dense_network.glsl"
#include "patch_triangles.glsl"

const uint kFeatures = TESSERA_MESH_FEATURES;
const uint kNumbers = kFeatures + 1;  // of a texel: the features, and the opacity

float halfAt(uint index) {
  const vec2 pair = unpackHalf2x16(arguments.values.table.values[index / 2]);
  return (index & 1) == 0 ? pair.x : pair.y;
}

// Sets the output of the encoder at a position in the unit cube.
void evaluate(vec3 position, inout float values[kMaxWidth]) {
  const uint features = arguments.values.features;
  for (uint l = 0; l < arguments.values.levelCount; ++l) {
    const LevelArguments level = arguments.values.levels[l];
    const Cell cell = findCell(position, level);
    for (uint f = 0; f < features; ++f) values[l * features + f] = 0;
    for (uint corner = 0; corner < 8; ++corner) {
      const float weight = cornerWeight(cell, corner);
      const uint entry = cornerEntry(cell, corner, level);
      for (uint f = 0; f < features; ++f) values[l * features + f] += weight * halfAt(entry * features + f);
    }
  }
  runNetwork(LayersPointer(arguments.values.layers), arguments.values.layerCount, FloatPointer(arguments.values.weights),
             values);
}

// The position of a place of a patch in the unit cube (texelPosition of patch_texels.cpp). `at`: 0 to 1 between texels.
vec3 placePosition(vec3 corners[4], bool isPair, vec2 at) {
  if (at.x + at.y <= 1 || !isPair) return corners[0] + at.x * (corners[1] - corners[0]) + at.y * (corners[2] - corners[0]);
  return corners[3] + (1 - at.x) * (corners[2] - corners[3]) + (1 - at.y) * (corners[1] - corners[3]);
}

// The nearest byte of a number between 0 and 1.
uint toByte(float share) { return uint(clamp(share, 0, 1) * 255 + 0.5); }

// Returns the block of sixteen bytes, four in a word, with their range as end points (encodeBc4 of src/tiles/bc4.cpp).
uvec2 compressBlock(uint texels[4]) {
  int low = 255, high = 0;
  for (uint i = 0; i < 16; ++i) {
    const int value = int(texels[i / 4] >> 8 * (i % 4) & 0xff);
    low = min(low, value);
    high = max(high, value);
  }
  uvec2 block = uvec2(high | low << 8, 0);
  if (low == high) return block;
  for (uint i = 0; i < 16; ++i) {
    const int value = int(texels[i / 4] >> 8 * (i % 4) & 0xff);
    // Sevenths are whole numbers here. Of equally near entries of the palette, the first counts.
    uint best = 0;
    int least = 7 * (high - value);
    for (uint k = 1; k < 8; ++k) {
      const int entry = k == 1 ? 7 * low : int(8 - k) * high + int(k - 1) * low;
      const int error = abs(entry - 7 * value);
      if (error < least) {
        least = error;
        best = k;
      }
    }
    const uint bit = 16 + 3 * i;
    if (bit < 32) block.x |= best << bit;
    if (bit > 29) block.y |= bit < 32 ? best >> (32 - bit) : best << (bit - 32);
  }
  return block;
}

void main() {
  MeshPartPointer part = arguments.values.part;
  const uint edge = part.value.patchEdge, across = part.value.patchesAcross, places = arguments.values.places;
  const uint blocksOfPatch = edge / 4 * (edge / 4);
  FOR_EACH(number, arguments.values.blocks) {
    const uint patchNumber = number / blocksOfPatch, inPatch = number % blocksOfPatch;
    const uvec2 first = 4 * uvec2(inPatch % (edge / 4), inPatch / (edge / 4));
    vec3 corners[4];
    for (uint corner = 0; corner < 4; ++corner) {
      const vec3 v = patchCorner(part.value.vertices, patchNumber, corner);
      for (uint axis = 0; axis < 3; ++axis)
        corners[corner][axis] = arguments.values.unitOrigin[axis] + arguments.values.unitStep[axis] * v[axis];
    }
    uint texels[kNumbers][4];
    for (uint n = 0; n < kNumbers; ++n)
      for (uint word = 0; word < 4; ++word) texels[n][word] = 0;
    for (uint texel = 0; texel < 16; ++texel) {
      float sums[kNumbers];
      for (uint n = 0; n < kNumbers; ++n) sums[n] = 0;
      const float share = 1 / float(places * places);
      for (uint place = 0; place < places * places; ++place) {
        const vec2 within = (vec2(place % places, place / places) + 0.5) / float(places) - 0.5;
        const vec2 at = (vec2(first + uvec2(texel % 4, texel / 4)) + within) / float(edge - 1);
        float values[kMaxWidth];
        evaluate(clamp(placePosition(corners, patchNumber < part.value.pairs, at), 0, 1), values);
        for (uint f = 0; f < kFeatures; ++f) sums[f] += share * values[f];
        sums[kFeatures] += share / (1 + exp(-values[0] - arguments.values.opacityOffset));
      }
      const float opacity = sums[kFeatures];
      for (uint n = 0; n < kNumbers; ++n) {
        float stored = opacity >= arguments.values.opaqueFrom ? 1 : opacity < arguments.values.transparentBelow ? 0 : opacity;
        if (n < kFeatures) stored = part.value.span[n] > 0 ? (sums[n] - part.value.low[n]) / part.value.span[n] : 0;
        texels[n][texel / 4] |= toByte(stored) << 8 * (texel % 4);
      }
    }
    const uint column = patchNumber % across * edge + first.x, row = patchNumber / across * edge + first.y;
    const uint block = column / 4 + across * edge / 4 * (row / 4);
    for (uint n = 0; n < kNumbers; ++n) {
      const uvec2 words = compressBlock(texels[n]);
      if (n < kFeatures) {
        UintPointer texture = part.value.features[n / 2];
        texture.values[4 * block + 2 * (n % 2)] = words.x;
        texture.values[4 * block + 2 * (n % 2) + 1] = words.y;
      } else {
        part.value.opacities.values[2 * block] = words.x;
        part.value.opacities.values[2 * block + 1] = words.y;
      }
    }
  }
}
