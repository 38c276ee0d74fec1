#include "compute/patches.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "compute/cpu/kernels.h"
#include "compute/cpu/ranked_marks.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kHitsPerTask = 2048, kTexelRowsPerTask = 1024;
constexpr uint32_t kFeatures = StoreTexelsForward::kFeatures, kStored = StoreTexelsForward::kStored;
constexpr uint32_t kMaxMixedColumns = 16;

// Limits to [0, last]; 0 for a coordinate that is no number.
float limitToPatch(float coordinate, float last) {
  return coordinate > 0 ? std::min(coordinate, last) : 0;
}

// Writes the four texels and weights of a hit on the face with the place `place`. `factors`: of all patches, or null.
void findPatchTexels(uint32_t patchEdge, uint32_t place, const float* barycentrics, const float* factors,
                     uint32_t* texels, float* weights) {
  const uint32_t patch = place / 16;
  const bool isSecond = (place & kSecondTriangle) != 0;
  const std::array<uint32_t, 3> permutation = patchPermutation(place % 8);
  const float ofVertex[3] = {1 - barycentrics[0] - barycentrics[1], barycentrics[0], barycentrics[1]};
  float share[3];  // of the corners of the triangle
  for (int vertex = 0; vertex < 3; ++vertex) share[permutation[vertex]] = ofVertex[vertex];
  if (factors) {
    for (uint32_t corner = 0; corner < 3; ++corner)
      share[corner] *= factors[size_t{4} * patch + patchCorner(isSecond, corner)];
    const float sum = share[0] + share[1] + share[2];
    for (float& one : share) one /= sum;
  }
  const float last = static_cast<float>(patchEdge - 1);
  uint32_t first[2];  // column and row
  float between[2];   // how far from there to the next column and row
  for (const int i : {0, 1}) {
    const float at = limitToPatch(last * (isSecond ? 1 - share[1 + i] : share[1 + i]), last);
    first[i] = std::min(static_cast<uint32_t>(at), patchEdge - 2);
    between[i] = at - static_cast<float>(first[i]);
  }
  texels[0] = (patch * patchEdge + first[1]) * patchEdge + first[0];
  texels[1] = texels[0] + 1;
  texels[2] = texels[0] + patchEdge;
  texels[3] = texels[2] + 1;
  weights[0] = (1 - between[0]) * (1 - between[1]);
  weights[1] = between[0] * (1 - between[1]);
  weights[2] = (1 - between[0]) * between[1];
  weights[3] = between[0] * between[1];
}

float computeTexelOpacity(float logit) {
  return 1 / (1 + std::exp(-logit));
}

// floor(255 x + ½) / 255
float roundToByte(float x) {
  return std::floor(255 * x + 0.5f) / 255;
}

// A matrix whose elements are at row · rowStride + offsets[column].
template <class T>
struct ColumnOffsets {
  T* data;
  size_t rowStride;
  std::array<size_t, kMaxMixedColumns> offsets{};

  explicit ColumnOffsets(const Matrix<T>& matrix) : data(hostPointer(matrix.data)), rowStride(matrix.rowStride) {
    CHECK(matrix.columns <= kMaxMixedColumns);
    for (uint32_t c = 0; c < matrix.columns; ++c) offsets[c] = matrix.offset(0, c);
  }
  T* row(size_t row) const { return data + row * rowStride; }
};

// Adds the gradients of all samples to the input rows [low, high).
void addMixedGradients(const MixRowsBackward& a, size_t samples, uint32_t low, uint32_t high) {
  const uint32_t* rows = hostPointer(a.rows);
  const float* weights = hostPointer(a.weights);
  const ColumnOffsets<const float> upstream(a.outputGradients);
  const ColumnOffsets<float> sums(a.inputGradients);
  for (size_t i = 0; i < samples * a.perSample; ++i) {
    if (rows[i] < low || rows[i] >= high || weights[i] == 0) continue;
    const float* from = upstream.row(i / a.perSample);
    float* to = sums.row(rows[i]);
    for (uint32_t c = 0; c < a.inputGradients.columns; ++c)
      to[sums.offsets[c]] += weights[i] * from[upstream.offsets[c]];
  }
}

}  // namespace

void run(Context& context, const PatchTexels& a) {
  CHECK((a.patchEdge >= 2u && a.patchEdge <= 64u));
  const uint32_t* places = hostPointer(a.patchOfFace);
  const uint32_t* faces = hostPointer(a.faces);
  const float* barycentrics = hostPointer(a.barycentrics);
  const float* factors = hostPointer(a.cornerFactors);
  uint32_t* texels = hostPointer(a.texels);
  float* weights = hostPointer(a.weights);
  context.pool.forRanges(hostCount(a.samples), kHitsPerTask, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) {
      const uint32_t place = places[faces[s]];
      if (place == kNoPatch) {
        std::fill_n(texels + 4 * s, 4, 0u);
        std::fill_n(weights + 4 * s, 4, 0.0f);
      } else {
        findPatchTexels(a.patchEdge, place, barycentrics + 2 * s, factors, texels + 4 * s, weights + 4 * s);
      }
    }
  });
}

void run(Context& context, const DistinctRows& a) {
  const size_t count = size_t{a.perSample} * hostCount(a.samples), words = a.words();
  const uint32_t* ids = hostPointer(a.ids);
  uint32_t* marks = hostPointer(a.marks);
  uint32_t* ranks = hostPointer(a.ranks);
  uint32_t* rowIds = hostPointer(a.rowIds);
  uint32_t* rows = hostPointer(a.rows);
  clearMarks(context.pool, marks, words);
  context.pool.forRanges(count, 4 * kHitsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      if (ids[i] < a.idCount) setMark(marks, ids[i]);
  });
  *hostPointer(a.rowCount) = rankMarks(context.pool, marks, ranks, words, [&](uint32_t row, size_t id) {
    if (row < a.rowCapacity) rowIds[row] = static_cast<uint32_t>(id);
  });
  context.pool.forRanges(count, 4 * kHitsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint32_t row = ids[i] < a.idCount ? rankOfMark(marks, ranks, ids[i]) : kNoRow;
      rows[i] = row < a.rowCapacity ? row : kNoRow;
    }
  });
}

void run(Context& context, const StoreTexelsForward& a) {
  CHECK(a.features.columns == kFeatures);
  CHECK(a.stored.columns == kStored);
  const float* ranges = hostPointer(a.ranges);
  const ColumnOffsets<const float> features(a.features);
  const ColumnOffsets<float> stored(a.stored);
  context.pool.forRanges(hostCount(a.rows), kTexelRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* from = features.row(row);
      float* to = stored.row(row);
      for (uint32_t f = 0; f < kFeatures; ++f) {
        const float low = ranges[2 * f], width = ranges[2 * f + 1] - low;
        const float x = std::clamp(from[features.offsets[f]], low, std::max(low, ranges[2 * f + 1]));
        to[stored.offsets[f]] = width > 0 ? low + width * roundToByte((x - low) / width) : low;
      }
      const float opacity = computeTexelOpacity(from[features.offsets[0]] + a.offset);
      to[stored.offsets[kFeatures]] = opacity >= a.opaqueFrom        ? 1
                                      : opacity < a.transparentBelow ? 0
                                                                     : roundToByte(opacity);
    }
  });
}

void run(Context& context, const StoreTexelsBackward& a) {
  CHECK(a.features.columns == kFeatures);
  CHECK(a.storedGradients.columns == kStored);
  CHECK(a.featureGradients.columns == kFeatures);
  const float* ranges = hostPointer(a.ranges);
  const ColumnOffsets<const float> features(a.features), upstream(a.storedGradients);
  const ColumnOffsets<float> gradients(a.featureGradients);
  context.pool.forRanges(hostCount(a.rows), kTexelRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* from = features.row(row);
      const float* ofStored = upstream.row(row);
      float* to = gradients.row(row);
      for (uint32_t f = 0; f < kFeatures; ++f) {
        const float x = from[features.offsets[f]];
        to[gradients.offsets[f]] = ranges[2 * f] <= x && x <= ranges[2 * f + 1] ? ofStored[upstream.offsets[f]] : 0;
      }
      const float opacity = computeTexelOpacity(from[features.offsets[0]] + a.offset);
      to[gradients.offsets[0]] += ofStored[upstream.offsets[kFeatures]] * opacity * (1 - opacity);
    }
  });
}

void run(Context& context, const MixRowsForward& a) {
  CHECK(a.input.columns == a.output.columns);
  const uint32_t columns = a.output.columns, inputRows = hostCount(a.inputRows);
  const uint32_t* rows = hostPointer(a.rows);
  const float* weights = hostPointer(a.weights);
  const ColumnOffsets<const float> input(a.input);
  const ColumnOffsets<float> output(a.output);
  context.pool.forRanges(hostCount(a.samples), kHitsPerTask, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) {
      float sums[kMaxMixedColumns] = {};
      for (size_t i = s * a.perSample; i < (s + 1) * a.perSample; ++i) {
        if (rows[i] >= inputRows || weights[i] == 0) continue;
        const float* from = input.row(rows[i]);
        for (uint32_t c = 0; c < columns; ++c) sums[c] += weights[i] * from[input.offsets[c]];
      }
      float* to = output.row(s);
      for (uint32_t c = 0; c < columns; ++c) to[output.offsets[c]] = sums[c];
    }
  });
}

void run(Context& context, const MixRowsBackward& a) {
  CHECK(a.outputGradients.columns == a.inputGradients.columns);
  const size_t samples = hostCount(a.samples);
  const uint64_t inputRows = hostCount(a.inputRows);
  // The additions to each row are in the order of samples for any split, so the split may depend on the number of
  // threads.
  const size_t pieces = static_cast<size_t>(context.pool.threads());
  context.pool.run(pieces, [&](size_t piece, int) {
    const uint64_t low = inputRows * piece / pieces, high = inputRows * (piece + 1) / pieces;
    if (low < high) addMixedGradients(a, samples, static_cast<uint32_t>(low), static_cast<uint32_t>(high));
  });
}

}  // namespace tessera::cpu
