// HashGridBackward: one invocation per sample and level, which adds the sample's gradient to the eight table entries
// around it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_hash_grid.h"
#include "vectors.glsl"

layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kFeatures = 2;
#include "hash_grid.glsl"
KERNEL_ARGUMENTS(HashGridBackwardArguments)

void main() {
  const uint levelIndex = gl_WorkGroupID.y;
  const LevelArguments level = arguments.values.levels[levelIndex];
  MatrixArguments encoded = arguments.values.encodedGradients;

  FOR_EACH_ROW(sampleIndex, arguments.values.samples) {
    float gradient[kFeatures];
    bool any = false;
    [[unroll]] for (uint f = 0; f < kFeatures; ++f) {
      gradient[f] = encoded.data.values[elementIndex(encoded, sampleIndex, levelIndex * kFeatures + f)];
      any = any || gradient[f] != 0;
    }
    if (!any) continue;

    const Cell cell = findCell(pointAt(arguments.values.positions, sampleIndex), level);
    [[unroll]] for (uint corner = 0; corner < 8; ++corner) {
      const float weight = cornerWeight(cell, corner);
      const uint entry = cornerEntry(cell, corner, level) * kFeatures;
      [[unroll]] for (uint f = 0; f < kFeatures; ++f) {
        addTo(arguments.values.tableGradients, entry + f, weight * gradient[f]);
      }
    }
  }
}
