// First kernel of DistinctTexels: one invocation per corner of a sample sets the bit of its texel or, if texels are not
// shared, writes its position.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_virtual_grid.h"
#include "vectors.glsl"
#include "virtual_grid.glsl"

layout(local_size_x = 128) in;
layout(constant_id = 0) const bool kShareTexels = true;
KERNEL_ARGUMENTS(DistinctTexelsArguments)

void main() {
  DistinctTexelsArguments a = arguments.values;
  const uint rows = rowRangeEnd(a.samples) * a.grid.corners;
  FOR_EACH(row, rows) {
    const uint index = row / a.grid.corners;
    const Places places = findPlaces(a.grid, pointAt(a.positions, index));
    const uint texel = cornerAt(a.grid, places, row % a.grid.corners).texel;
    if (kShareTexels) {
      const uint word = a.blockOfSample.values[index] * a.grid.words + texel / 32;
      const uint bit = 1u << texel % 32;
      if ((a.marks.values[word] & bit) == 0) atomicOr(a.marks.values[word], bit);
    } else if (row < a.texelCapacity) {
      storePoint(a.texelPositions, row, texelPosition(a.grid, texel));
    }
  }
  if (kShareTexels) return;
  FOR_EACH(block, a.blocks + 1) a.firstTexel.values[block] = block == a.blocks ? rows : 0;
}
