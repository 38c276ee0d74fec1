// Position gradients of HashGridBackward: one invocation per sample, which sums over all levels. Within a cell the
// value is linear in each coordinate: the slope along an axis is scale · (mix of the upper face - mix of the lower
// face).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_hash_grid.h"
#include "vectors.glsl"

layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kFeatures = 2;
#include "hash_grid.glsl"
KERNEL_ARGUMENTS(HashGridBackwardArguments)

// ∂(g · mix)/∂position in one level.
vec3 slopeInLevel(vec3 position, uint sampleIndex, uint levelIndex) {
  const LevelArguments level = arguments.values.levels[levelIndex];
  MatrixArguments encoded = arguments.values.encodedGradients;
  const Cell cell = findCell(position, level);
  vec4 gradient[kQuads];
  [[unroll]] for (uint q = 0; q < kQuads; ++q) gradient[q] = vec4(0);
  [[unroll]] for (uint f = 0; f < kFeatures; ++f) {
    gradient[f / 4][f % 4] = encoded.data.values[elementIndex(encoded, sampleIndex, levelIndex * kFeatures + f)];
  }
  vec3 slope = vec3(0);
  [[unroll]] for (uint corner = 0; corner < 8; ++corner) {
    const uint entry = cornerEntry(cell, corner, level);
    float value = 0;  // g · θ
    [[unroll]] for (uint q = 0; q < kQuads; ++q) value += dot(gradient[q], entryQuad(arguments.values.table, entry, q));
    const bvec3 upper = upperSides(corner);
    const vec3 w = mix(1.0 - cell.fraction, cell.fraction, upper);
    slope += mix(vec3(-1), vec3(1), upper) * w.yxx * w.zzy * value;
  }
  return level.scale * slope;
}

void main() {
  FloatPointer gradients = arguments.values.positionGradients;
  FOR_EACH_ROW(sampleIndex, arguments.values.samples) {
    const vec3 position = pointAt(arguments.values.positions, sampleIndex);
    vec3 sum = vec3(0);
    for (uint l = 0; l < arguments.values.levelCount; ++l) sum += slopeInLevel(position, sampleIndex, l);
    for (uint axis = 0; axis < 3; ++axis) gradients.values[sampleIndex * 3 + axis] = sum[axis];
  }
}
