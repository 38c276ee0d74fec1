// mlp_weight_gradients.comp with cooperative matrices: a workgroup sums kRows × kColumns weights, 64 samples at a time.
// Its four subgroups divide the rows and, if there are too few rows, the samples.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"
#include "matrix_tiles.glsl"
#include "mlp_output_gradient.glsl"

const uint kDepth = 64;  // samples at a time
layout(constant_id = 0) const uint kRows = 64;  // multiples of 16
layout(constant_id = 1) const uint kColumns = 64;
KERNEL_ARGUMENTS(MlpWeightGradientsArguments)

const uint kRowStride = kRows + 8, kColumnStride = kColumns + 8;
const uint kTilesDown = kRows / kTileRows;
const uint kRowShares = kTilesDown < kSubgroups ? kTilesDown : kSubgroups;
const uint kRowTiles = kTilesDown / kRowShares;  // per subgroup
const uint kColumnTiles = kColumns / kTileColumns;
const uint kPart = kDepth / (kSubgroups / kRowShares);  // samples per subgroup
const uint kTileNumbers = kTileRows * kTileColumns;

shared float16_t afterTile[kDepth * kRowStride];
shared float16_t beforeTile[kDepth * kColumnStride];
shared float staging[kSubgroups * kTileNumbers];
TileSum sums[kRowTiles * kColumnTiles];

uint tileRow(uint r) { return (kSubgroup % kRowShares + r * kRowShares) * kTileRows; }

// Loads samples [first, first + 64); those beyond the last are zero.
void load(MlpWeightGradientsArguments a, uint first, uint samples, uint firstRow, uint firstColumn) {
  [[unroll]] for (uint n = 0; n < kDepth * kRows / 4 / kThreads; ++n) {
    const uint i = n * kThreads + gl_LocalInvocationIndex, index = first + i / (kRows / 4), quad = i % (kRows / 4);
    const f16vec4 four = index < samples ? QuadPointer(a.after).values[(index * a.rows + firstRow) / 4 + quad] : f16vec4(0);
    [[unroll]] for (uint k = 0; k < 4; ++k) afterTile[i / (kRows / 4) * kRowStride + 4 * quad + k] = four[k];
  }
  if (IS_SET(a.inputs.data)) {
    for (uint column = gl_LocalInvocationIndex % 16; column < kColumns; column += 16) {
      const bool has = firstColumn + column < a.inputs.columns;
      const uint offset = has ? columnOffset(a.inputs, firstColumn + column) : 0;
      [[unroll]] for (uint n = 0; n < kDepth * 16 / kThreads; ++n) {
        const uint i = n * kThreads / 16 + gl_LocalInvocationIndex / 16;
        const bool inside = has && first + i < samples;
        beforeTile[i * kColumnStride + column] =
            toNumber(inside ? a.inputs.data.values[offset + (first + i) * a.inputs.rowStride] : 0);
      }
    }
    return;
  }
  [[unroll]] for (uint n = 0; n < kDepth * kColumns / 4 / kThreads; ++n) {
    const uint i = n * kThreads + gl_LocalInvocationIndex, index = first + i / (kColumns / 4), quad = i % (kColumns / 4);
    const f16vec4 four =
        index < samples ? QuadPointer(a.activations).values[(index * a.columns + firstColumn) / 4 + quad] : f16vec4(0);
    [[unroll]] for (uint k = 0; k < 4; ++k) beforeTile[i / (kColumns / 4) * kColumnStride + 4 * quad + k] = four[k];
  }
}

void main() {
  MlpWeightGradientsArguments a = arguments.values;
  const uint samples = rowRangeEnd(a.samples);
  if (rowRangeBegin(a.samples) + gl_WorkGroupID.z * kDepth >= samples) return;
  const uint firstColumn = gl_WorkGroupID.x * kColumns, firstRow = gl_WorkGroupID.y * kRows;
  const uint part = kSubgroup / kRowShares * kPart;

  [[unroll]] for (uint i = 0; i < kRowTiles * kColumnTiles; ++i) { CLEAR_SUM(sums[i]); }
  for (uint first = rowRangeBegin(a.samples) + gl_WorkGroupID.z * kDepth; first < samples; first += gl_NumWorkGroups.z * kDepth) {
    barrier();
    load(a, first, samples, firstRow, firstColumn);
    barrier();
    for (uint k0 = part; k0 < part + kPart; k0 += kTileDepth) {
      [[unroll]] for (uint r = 0; r < kRowTiles; ++r) {
        TileA after;
        LOAD_A(after, afterTile, k0 * kRowStride + tileRow(r), kRowStride, true);
        [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) {
          TileB before;
          LOAD_B(before, beforeTile, k0 * kColumnStride + c * kTileColumns, kColumnStride, false);
          MULTIPLY_ADD(sums[r * kColumnTiles + c], after, before);
        }
      }
    }
  }

  const float scale = 1 / lossScale(a.largest, a.largestCount);
  [[unroll]] for (uint r = 0; r < kRowTiles; ++r) {
    [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) {
      subgroupWait();
      STORE_SUM(sums[r * kColumnTiles + c], staging, kSubgroup * kTileNumbers, kTileColumns);
      subgroupWait();
      for (uint i = kLane; i < kTileNumbers; i += kSubgroupSize) {
        const float sum = staging[kSubgroup * kTileNumbers + i];
        const uint row = firstRow + tileRow(r) + i / kTileColumns, column = firstColumn + c * kTileColumns + i % kTileColumns;
        if (sum != 0) addTo(a.gradients, row * a.columns + column, sum * scale);
      }
    }
  }
}
