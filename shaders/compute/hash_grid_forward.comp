// HashGridForward: one invocation per sample and level, which interpolates the eight table entries around the sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_hash_grid.h"
#include "vectors.glsl"

layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kFeatures = 2;
#include "hash_grid.glsl"
KERNEL_ARGUMENTS(HashGridForwardArguments)

void main() {
  const uint levelIndex = gl_WorkGroupID.y;
  const LevelArguments level = arguments.values.levels[levelIndex];
  FloatPointer table = arguments.values.table;
  MatrixArguments encoded = arguments.values.encoded;

  FOR_EACH_ROW(sampleIndex, arguments.values.samples) {
    const Cell cell = findCell(pointAt(arguments.values.positions, sampleIndex), level);
    vec4 mixed[kQuads];
    [[unroll]] for (uint q = 0; q < kQuads; ++q) mixed[q] = vec4(0);
    [[unroll]] for (uint corner = 0; corner < 8; ++corner) {
      const float weight = cornerWeight(cell, corner);
      const uint entry = cornerEntry(cell, corner, level);
      [[unroll]] for (uint q = 0; q < kQuads; ++q) mixed[q] += weight * entryQuad(table, entry, q);
    }
    [[unroll]] for (uint f = 0; f < kFeatures; ++f) {
      encoded.data.values[elementIndex(encoded, sampleIndex, levelIndex * kFeatures + f)] = mixed[f / 4][f % 4];
    }
  }
}
