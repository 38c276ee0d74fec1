// Weight gradients of one layer. A workgroup sums a 32 × 32 tile over its share of the samples, then adds it to the
// result. The workgroup's x and y select the tile, its z the share. Each invocation sums 4 × 4 weights.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"

const uint kQuads = 8;    // vectors of four along a side of the tile
const uint kDepth = 16;   // samples at a time
const uint kThreads = 64;
layout(local_size_x = 64) in;
#include "mlp_output_gradient.glsl"
KERNEL_ARGUMENTS(MlpWeightGradientsArguments)

shared NumberQuad afterTile[kDepth * kQuads];
shared NumberQuad beforeTile[kDepth * kQuads];

void main() {
  MlpWeightGradientsArguments a = arguments.values;
  const uint samples = rowRangeEnd(a.samples);
  if (rowRangeBegin(a.samples) + gl_WorkGroupID.z * kDepth >= samples) return;
  const uint firstColumn = gl_WorkGroupID.x * 4 * kQuads;
  const uint firstRow = gl_WorkGroupID.y * 4 * kQuads;
  const bool ofInputs = IS_SET(a.inputs.data);

  // This invocation loads the same four rows and columns of every sixteenth sample.
  const uint quad = gl_LocalInvocationIndex % kQuads;
  const uint row = firstRow + 4 * quad, column = firstColumn + 4 * quad;
  uint offsets[4];
  [[unroll]] for (uint k = 0; k < 4; ++k) offsets[k] = ofInputs ? columnOffset(a.inputs, column + k) : 0;

  const uint rowQuad = gl_LocalInvocationIndex / kQuads, columnQuad = quad;
  vec4 sums[4];
  [[unroll]] for (uint r = 0; r < 4; ++r) sums[r] = vec4(0);
  for (uint first = rowRangeBegin(a.samples) + gl_WorkGroupID.z * kDepth; first < samples; first += gl_NumWorkGroups.z * kDepth) {
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < kDepth * kQuads; i += kThreads) {
      const uint index = first + i / kQuads;
      const bool inside = index < samples;
      NumberQuad before = NumberQuad(0);
      if (inside && ofInputs) {
        [[unroll]] for (uint k = 0; k < 4; ++k) {
          if (column + k >= a.inputs.columns) continue;
          before[k] = toNumber(a.inputs.data.values[offsets[k] + index * a.inputs.rowStride]);
        }
      } else if (inside && column < a.columns) {
        before = QuadPointer(a.activations).values[(index * a.columns + column) / 4];
      }
      beforeTile[i] = before;
      afterTile[i] =
          inside && row < a.rows ? QuadPointer(a.after).values[(index * a.rows + row) / 4] : NumberQuad(0);
    }
    barrier();
    for (uint k = 0; k < kDepth; ++k) {
      const vec4 after = vec4(afterTile[k * kQuads + rowQuad]), before = vec4(beforeTile[k * kQuads + columnQuad]);
      [[unroll]] for (uint r = 0; r < 4; ++r) sums[r] += after[r] * before;
    }
  }

  const float scale = 1 / lossScale(a.largest, a.largestCount);
  [[unroll]] for (uint r = 0; r < 4; ++r) {
    [[unroll]] for (uint c = 0; c < 4; ++c) {
      const uint toRow = firstRow + 4 * rowQuad + r, toColumn = firstColumn + 4 * columnQuad + c;
      const float sum = sums[r][c];
      if (toRow < a.rows && toColumn < a.columns && sum != 0) {
        addTo(a.gradients, toRow * a.columns + toColumn, sum * scale);
      }
    }
  }
}
