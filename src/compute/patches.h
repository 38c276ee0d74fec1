// Patches of texels on the faces of octahedra grids, as `mesh` stores them: two triangles with a common edge share a
// square patch of T × T texels. Training looks up the hits of rays in the texels that a renderer will read: PatchTexels
// names the four texels around each hit, DistinctRows lists each texel once, the encoder computes the features of the
// listed ones, StoreTexelsForward limits them to what 8 bits can hold, and MixRowsForward mixes them bilinearly.
//
// The corners 0, 1, 2 and 3 of a patch lie at the centres of the texels (column, row) = (0, 0), (T - 1, 0), (0, T - 1)
// and (T - 1, T - 1). The corners of the first triangle are 0, 1, 2, and those of the second one are 3, 2, 1. Texel
// (column, row) of patch p has the number T² p + T row + column.
#pragma once

#include <array>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// A face's place in a patch is the number 16 · patch + code. Bit 3 of the code is set for the patch's second triangle;
// bits 0 to 2 are the number of the permutation that maps the face's vertices to the triangle's corners.
inline constexpr uint32_t kNoPatch = 0xffffffff;
inline constexpr uint32_t kSecondTriangle = 8;
inline constexpr uint32_t kPatchPermutations = 6;

// Vertex i of the face is corner number patchPermutation(p)[i] of the triangle; permutations are in lexicographic
// order.
constexpr std::array<uint32_t, 3> patchPermutation(uint32_t number) {
  const uint32_t first = number / 2, lower = first == 0 ? 1 : 0, upper = first == 2 ? 1 : 2;
  if (number % 2 == 0) return {first, lower, upper};
  return {first, upper, lower};
}

// The inverse: the number of the permutation with these three indices.
constexpr uint32_t patchPermutationNumber(const std::array<uint32_t, 3>& permutation) {
  return 2 * permutation[0] + (permutation[1] > permutation[2] ? 1 : 0);
}

// Returns the corner of the patch that is corner number `corner` of one of its triangles.
constexpr uint32_t patchCorner(bool isSecond, uint32_t corner) {
  return isSecond ? 3 - corner : corner;
}

// Finds the four texels around each hit, and their bilinear weights. With λ_i the barycentric coordinates of a hit in
// grid coordinates and ω_i the factors of its face's corners, s_i = λ_i ω_i / Σ_j λ_j ω_j are its barycentric
// coordinates in the scene: ω is the last homogeneous coordinate of the corner's position in the scene, computed by the
// inverse of OctahedraGrid::gridFromScene from the position in the grid. With the corners of the triangle numbered 0 to
// 2, (column, row) is (T - 1) (s_1, s_2) in the first triangle, and (T - 1) (1 - s_1, 1 - s_2) in the second one, both
// limited to [0, T - 1]. The texels are those of the columns x = min(⌊column⌋, T - 2) and x + 1, and of the rows
// likewise, in the order (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1). A hit on a face without a patch gets the
// texels 0 with the weights 0.
struct PatchTexels {
  Count samples;
  uint32_t patchEdge = 0;             // T, 2 to 64
  Slice<const uint32_t> patchOfFace;  // [number of faces]: 16 · patch + code, or kNoPatch
  Slice<const uint32_t> faces;        // [capacity]
  Slice<const float> barycentrics;    // [capacity][2], of the face's second and third vertex
  Slice<const float> cornerFactors;   // optional, [patches][4]: positive; 1 if absent
  Slice<uint32_t> texels;             // [capacity][4], overwritten
  Slice<float> weights;               // [capacity][4], overwritten
};
TESSERA_OPERATION(PatchTexels);

// The row of an id that has none; see DistinctRows.
inline constexpr uint32_t kNoRow = 0xffffffff;

// Lists the distinct ids of a batch in ascending order, and finds the row of each id in that list. Ids that do not fit
// into the list get kNoRow, which MixRowsForward takes for a row of zeros, and so do ids that are not below `idCount`.
struct DistinctRows {
  Count samples;
  uint32_t perSample = 4;
  Slice<const uint32_t> ids;  // [capacity][perSample]
  uint32_t idCount = 0;       // below 2^31
  uint32_t rowCapacity = 0;
  Slice<uint32_t> marks;     // [words()], overwritten: bit i is set if id i occurs
  Slice<uint32_t> ranks;     // [words()], overwritten: the row of the first id that occurs in that word or after it
  Slice<uint32_t> rowCount;  // [1], overwritten: number of distinct ids; not limited by the capacity
  Slice<uint32_t> rowIds;    // [rowCapacity]: the ids in ascending order; rows beyond their number are not written
  Slice<uint32_t> rows;      // [capacity][perSample], overwritten

  uint32_t words() const { return (idCount + 31) / 32; }
};
TESSERA_OPERATION(DistinctRows);

// What storing texels in 8 bits does to them. Feature f becomes low + (high - low) b / 255 with a byte b, that of its
// value x limited to [low, high]: ⌊255 (x - low) / (high - low) + ½⌋, or 0 where high ≤ low. Feature 0 is also the
// logit of the opacity 1 / (1 + exp(-x_0 - offset)), which becomes 1 from `opaqueFrom` on, 0 below `transparentBelow`,
// and ⌊255 opacity + ½⌋ / 255 in between.
struct StoreTexelsForward {
  static constexpr uint32_t kFeatures = 8, kStored = kFeatures + 1;

  Count rows;
  float offset = 0;
  float opaqueFrom = 1, transparentBelow = 0;
  Matrix<const float> features;  // kFeatures columns
  Slice<const float> ranges;     // [kFeatures][2]: low, high
  Matrix<float> stored;          // kStored columns, overwritten: features, opacity
};
TESSERA_OPERATION(StoreTexelsForward);

// Rounding passes gradients straight through: that of feature f is the gradient of the stored feature if low ≤ x ≤ high
// and zero otherwise, and that of feature 0 is larger by the gradient of the stored opacity times the slope of the
// opacity that was not rounded yet, also where it was rounded to 0 or 1.
struct StoreTexelsBackward {
  Count rows;
  float offset = 0;
  Matrix<const float> features;         // StoreTexelsForward::kFeatures columns
  Slice<const float> ranges;            // [kFeatures][2]
  Matrix<const float> storedGradients;  // StoreTexelsForward::kStored columns
  Matrix<float> featureGradients;       // kFeatures columns, overwritten
};
TESSERA_OPERATION(StoreTexelsBackward);

// output row s = Σ_k weights[s][k] · input row rows[s][k]. Rows that are not below the number of input rows, such as
// kNoRow, count as zero, and rows with the weight 0 are not read.
struct MixRowsForward {
  Count samples;
  uint32_t perSample = 4;
  Count inputRows;
  Slice<const uint32_t> rows;  // [capacity][perSample]
  Slice<const float> weights;  // [capacity][perSample]
  Matrix<const float> input;   // [inputRows.capacity], 1 to 16 columns
  Matrix<float> output;        // [capacity], as many columns, overwritten
};
TESSERA_OPERATION(MixRowsForward);

// The gradient with respect to the input; there is none with respect to the weights. Adds to `inputGradients`.
struct MixRowsBackward {
  Count samples;
  uint32_t perSample = 4;
  Count inputRows;
  Slice<const uint32_t> rows;           // [capacity][perSample]
  Slice<const float> weights;           // [capacity][perSample]
  Matrix<const float> outputGradients;  // [capacity], 1 to 16 columns
  Matrix<float> inputGradients;         // [inputRows.capacity], as many columns
};
TESSERA_OPERATION(MixRowsBackward);

}  // namespace tessera
