// Weight gradients of one layer. A workgroup sums a 32 × 32 tile over its share of the samples, then adds it to the
// whole: x and y of the workgroup choose the tile, z the share.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"

const uint kTile = 32;
const uint kDepth = 16;   // samples at a time
const uint kThreads = 64; // 8 × 8, each sums 4 × 4 weights
layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(MlpWeightGradientsArguments)

shared float afterTile[kDepth * kTile];
shared float beforeTile[kDepth * kTile];

void main() {
  MlpWeightGradientsArguments a = arguments.values;
  const uint samples = endOf(a.samples);
  const uint firstColumn = gl_WorkGroupID.x * kTile;
  const uint firstRow = gl_WorkGroupID.y * kTile;
  const uint tileColumn = gl_LocalInvocationIndex % 8;
  const uint tileRow = gl_LocalInvocationIndex / 8;

  float sums[16];
  [[unroll]] for (uint i = 0; i < 16; ++i) sums[i] = 0;
  for (uint first = firstOf(a.samples) + gl_WorkGroupID.z * kDepth; first < samples; first += gl_NumWorkGroups.z * kDepth) {
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < kDepth * kTile; i += kThreads) {
      const uint index = first + i / kTile;
      const uint row = firstRow + i % kTile, column = firstColumn + i % kTile;
      const bool inside = index < samples;
      afterTile[i] = inside && row < a.rows ? a.after.values[index * a.rows + row] : 0;
      beforeTile[i] =
          inside && column < a.before.columns ? a.before.data.values[elementOf(a.before, index, column)] : 0;
    }
    barrier();
    for (uint k = 0; k < kDepth; ++k) {
      float before[4];
      [[unroll]] for (uint c = 0; c < 4; ++c) before[c] = beforeTile[k * kTile + c * 8 + tileColumn];
      [[unroll]] for (uint r = 0; r < 4; ++r) {
        const float after = afterTile[k * kTile + r * 8 + tileRow];
        [[unroll]] for (uint c = 0; c < 4; ++c) sums[r * 4 + c] += after * before[c];
      }
    }
  }

  [[unroll]] for (uint r = 0; r < 4; ++r) {
    [[unroll]] for (uint c = 0; c < 4; ++c) {
      const uint row = firstRow + r * 8 + tileRow, column = firstColumn + c * 8 + tileColumn;
      const float sum = sums[r * 4 + c];
      if (row < a.rows && column < a.columns && sum != 0) addTo(a.gradients, row * a.columns + column, sum);
    }
  }
}
