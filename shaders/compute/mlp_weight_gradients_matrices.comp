// mlp_weight_gradients.comp by cooperative matrices: a workgroup sums a tile of 16 kRowTiles × 16 kColumnTiles weights,
// 64 samples at a time. Its four subgroups share out the rows, and the samples where there are fewer rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"
#include "mlp_output_gradient.glsl"
#include "matrix_tiles.glsl"

const uint kThreads = 128;
const uint kSubgroups = kThreads / kSubgroupSize;
const uint kDepth = 64;  // samples at a time
layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kRowTiles = 4;  // 1, 2 or 4
layout(constant_id = 1) const uint kColumnTiles = 4;
KERNEL_ARGUMENTS(MlpWeightGradientsArguments)

const uint kRows = 16 * kRowTiles, kColumns = 16 * kColumnTiles;
const uint kRowStride = kRows + 8, kColumnStride = kColumns + 8;
const uint kParts = kSubgroups / kRowTiles;  // of the samples

shared float16_t afterTile[kDepth * kRowStride];
shared float16_t beforeTile[kDepth * kColumnStride];
shared float given[kSubgroups * 256];
TileSum sums[kColumnTiles];

// Samples [first, first + 64); those beyond the last are zero.
void load(MlpWeightGradientsArguments a, uint first, uint samples, uint firstRow, uint firstColumn) {
  for (uint i = gl_LocalInvocationIndex; i < kDepth * kRows / 4; i += kThreads) {
    const uint index = first + i / (kRows / 4), quad = i % (kRows / 4);
    const f16vec4 four = index < samples ? QuadPointer(a.after).values[(index * a.rows + firstRow) / 4 + quad] : f16vec4(0);
    [[unroll]] for (uint k = 0; k < 4; ++k) afterTile[i / (kRows / 4) * kRowStride + 4 * quad + k] = four[k];
  }
  if (WANTED(a.inputs.data)) {
    for (uint column = gl_LocalInvocationIndex % 16; column < kColumns; column += 16) {
      const bool has = firstColumn + column < a.inputs.columns;
      const uint offset = has ? columnOffset(a.inputs, firstColumn + column) : 0;
      for (uint i = gl_LocalInvocationIndex / 16; i < kDepth; i += kThreads / 16) {
        const bool inside = has && first + i < samples;
        beforeTile[i * kColumnStride + column] =
            toNumber(inside ? a.inputs.data.values[offset + (first + i) * a.inputs.rowStride] : 0);
      }
    }
    return;
  }
  for (uint i = gl_LocalInvocationIndex; i < kDepth * kColumns / 4; i += kThreads) {
    const uint index = first + i / (kColumns / 4), quad = i % (kColumns / 4);
    const f16vec4 four =
        index < samples ? QuadPointer(a.activations).values[(index * a.columns + firstColumn) / 4 + quad] : f16vec4(0);
    [[unroll]] for (uint k = 0; k < 4; ++k) beforeTile[i / (kColumns / 4) * kColumnStride + 4 * quad + k] = four[k];
  }
}

void main() {
  MlpWeightGradientsArguments a = arguments.values;
  const uint samples = endOf(a.samples);
  const uint firstColumn = gl_WorkGroupID.x * kColumns, firstRow = gl_WorkGroupID.y * kRows;
  const uint tileRow = kSubgroup % kRowTiles * 16, part = kSubgroup / kRowTiles;

  [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) { CLEAR_SUM(sums[c]); }
  for (uint first = firstOf(a.samples) + gl_WorkGroupID.z * kDepth; first < samples; first += gl_NumWorkGroups.z * kDepth) {
    barrier();
    load(a, first, samples, firstRow, firstColumn);
    barrier();
    for (uint k0 = part * (kDepth / kParts); k0 < (part + 1) * (kDepth / kParts); k0 += 16) {
      TileA after;
      LOAD_A(after, afterTile, k0 * kRowStride + tileRow, kRowStride, true);
      [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) {
        TileB before;
        LOAD_B(before, beforeTile, k0 * kColumnStride + c * 16, kColumnStride, false);
        MULTIPLY_ADD(sums[c], after, before);
      }
    }
  }

  const float scale = 1 / lossScale(a.largest, a.largestCount);
  [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) {
    subgroupWait();
    STORE_SUM(sums[c], given, kSubgroup * 256, 16);
    subgroupWait();
    for (uint i = kLane; i < 256; i += kSubgroupSize) {
      const float sum = given[kSubgroup * 256 + i];
      const uint to = (firstRow + tileRow + i / 16) * a.columns + firstColumn + c * 16 + i % 16;
      if (sum != 0) addTo(a.gradients, to, sum * scale);
    }
  }
}
