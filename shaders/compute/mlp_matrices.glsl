// The functions of mlp_tile.glsl with cooperative matrices: each of four subgroups sums tiles of the block. The weights
// are read directly from device memory (fp16, see halve_numbers.comp), each once per block or once per row of
// subgroups.
// Include after number.glsl. Defines: kThreads, kWidth, kBlock, STATE(), STATE_QUAD(), SET_STATE_QUAD(), clearSums(),
// accumulate(), storeSumsToState(), outputSums(), which calls the kernel's storeSum().
#include "matrix_tiles.glsl"

layout(constant_id = 0) const uint kWidth = 64;       // width of the hidden layers
layout(constant_id = 1) const uint kBlock = 128;      // samples per workgroup, a multiple of 64
layout(constant_id = 2) const uint kStateWidth = 64;  // at least kWidth

// Tiles are distributed over subgroups along the columns first.
const uint kTilesAcross = kWidth / kTileColumns;
const uint kColumnShares = kTilesAcross < kSubgroups ? kTilesAcross : kSubgroups;
const uint kRowShares = kSubgroups / kColumnShares;
const uint kColumnTiles = kTilesAcross / kColumnShares;  // per subgroup
const uint kRowTiles = kBlock / kTileRows / kRowShares;
const uint kStride = kStateWidth + 8;  // padding against bank conflicts: eight rows lie in different banks
const uint kTileNumbers = kTileRows * kTileColumns;

shared float16_t state[kBlock * kStride];
shared float staging[kSubgroups * kTileNumbers];
TileSum sums[kColumnTiles * kRowTiles];

#define STATE(row, column) state[(row) * kStride + (column)]
#define STATE_QUAD(row, quad)                                                                \
  f16vec4(STATE(row, 4 * (quad)), STATE(row, 4 * (quad) + 1), STATE(row, 4 * (quad) + 2),    \
          STATE(row, 4 * (quad) + 3))
#define SET_STATE_QUAD(row, quad, four) \
  [[unroll]] for (uint k = 0; k < 4; ++k) STATE(row, 4 * (quad) + k) = (four)[k]

// Return the first sample (within the block) and the first neuron of this subgroup's tile (r, c).
uint tileRow(uint r) { return (kSubgroup / kColumnShares + r * kRowShares) * kTileRows; }
uint tileColumn(uint c) { return (kSubgroup % kColumnShares + c * kColumnShares) * kTileColumns; }

void clearSums() {
  [[unroll]] for (uint i = 0; i < kColumnTiles * kRowTiles; ++i) { CLEAR_SUM(sums[i]); }
}

void accumulate(NumberPointer weights, uint first, uint kStep, uint nStep, uint depth, uint columns) {
  barrier();
  for (uint k0 = 0; k0 < depth; k0 += kTileDepth) {
    [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) {
      const uint n0 = tileColumn(c);
      if (n0 >= columns) continue;
      TileB b;
      const uint at = first + k0 * kStep + n0 * nStep;
      if (kStep == 1) {
        LOAD_B(b, weights.values, at, nStep, true);
      } else {
        LOAD_B(b, weights.values, at, kStep, false);
      }
      [[unroll]] for (uint r = 0; r < kRowTiles; ++r) {
        TileA a;
        LOAD_A(a, state, tileRow(r) * kStride + k0, kStride, false);
        MULTIPLY_ADD(sums[c * kRowTiles + r], a, b);
      }
    }
  }
}

void storeSumsToState(bool rectified) {
  const float minimum = rectified ? 0 : -kMaxHalf;  // the lowest number of fp16
  barrier();
  [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) {
    [[unroll]] for (uint r = 0; r < kRowTiles; ++r) {
      CONVERT_AND_STORE(sums[c * kRowTiles + r], minimum, state, tileRow(r) * kStride + tileColumn(c), kStride);
    }
  }
}

void storeSum(uint row, uint column, float sum);
void outputSums(uint firstRow, uint firstColumn) {
  [[unroll]] for (uint c = 0; c < kColumnTiles; ++c) {
    [[unroll]] for (uint r = 0; r < kRowTiles; ++r) {
      subgroupWait();
      STORE_SUM(sums[c * kRowTiles + r], staging, kSubgroup * kTileNumbers, kTileColumns);
      subgroupWait();
      for (uint i = kLane; i < kTileNumbers; i += kSubgroupSize) {
        storeSum(firstRow + tileRow(r) + i / kTileColumns, firstColumn + tileColumn(c) + i % kTileColumns,
             staging[kSubgroup * kTileNumbers + i]);
      }
    }
  }
}
