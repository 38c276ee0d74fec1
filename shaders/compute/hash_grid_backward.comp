// HashGridBackward: adds a sample's gradient to the eight table entries around it. One invocation per sample, level,
// feature, and side along x.
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

// Neighbouring invocations add to neighbouring numbers: the features of an entry, and the entries of the two corners along
// x, which are next to each other in dense levels and often in hashed ones. A GPU combines them into one access.
const uint kLanes = 2 * kFeatures;

void main() {
  const uint levelIndex = gl_WorkGroupID.y;
  const LevelArguments level = arguments.values.levels[levelIndex];
  MatrixArguments encoded = arguments.values.encodedGradients;
  const uint feature = gl_LocalInvocationIndex % kFeatures, side = gl_LocalInvocationIndex / kFeatures % 2;

  const uint samples = rowRangeEnd(arguments.values.samples), samplesAtOnce = gl_NumWorkGroups.x * (gl_WorkGroupSize.x / kLanes);
  for (uint sampleIndex = rowRangeBegin(arguments.values.samples) + gl_GlobalInvocationID.x / kLanes; sampleIndex < samples;
       sampleIndex += samplesAtOnce) {
    const float gradient = encoded.data.values[elementIndex(encoded, sampleIndex, levelIndex * kFeatures + feature)];
    if (gradient == 0) continue;
    const Cell cell = findCell(pointAt(arguments.values.positions, sampleIndex), level);
    [[unroll]] for (uint pair = 0; pair < 4; ++pair) {
      const uint corner = 2 * pair + side;
      addTo(arguments.values.tableGradients, cornerEntry(cell, corner, level) * kFeatures + feature,
            cornerWeight(cell, corner) * gradient);
    }
  }
}
