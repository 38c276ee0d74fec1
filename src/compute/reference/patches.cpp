#include "compute/patches.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

std::array<PatchTexel, 4> patchTexels(uint32_t patchEdge, uint32_t place, const Point& barycentrics, View factors) {
  CHECK((patchEdge >= 2u && patchEdge <= 64u));
  const uint32_t patch = place / 16;
  const bool isSecond = (place & kSecondTriangle) != 0;
  const std::array<uint32_t, 3> permutation = patchPermutation(place % 8);
  double share[3] = {}, sum = 0;  // of the corners of the triangle
  for (uint32_t vertex = 0; vertex < 3; ++vertex) {
    const uint32_t corner = permutation[vertex];
    share[corner] = barycentrics[vertex];
    if (!factors.empty()) share[corner] *= factors[patchCorner(isSecond, corner)];
    sum += share[corner];
  }
  const double last = patchEdge - 1;
  uint32_t first[2];  // column and row
  double between[2];  // how far from there to the next column and row
  for (const int i : {0, 1}) {
    const double along = factors.empty() ? share[1 + i] : share[1 + i] / sum;
    const double at = std::clamp(last * (isSecond ? 1 - along : along), 0.0, last);
    first[i] = std::min(static_cast<uint32_t>(at), patchEdge - 2);
    between[i] = at - first[i];
  }
  std::array<PatchTexel, 4> texels;
  for (uint32_t k = 0; k < 4; ++k) {
    const uint32_t column = k % 2, row = k / 2;
    texels[k] = {(patch * patchEdge + first[1] + row) * patchEdge + first[0] + column,
                 (column ? between[0] : 1 - between[0]) * (row ? between[1] : 1 - between[1])};
  }
  return texels;
}

Doubles storedTexel(const StoreTexelsForward& a, View ranges, View features, bool rounds) {
  const auto toByte = [&](double share) { return rounds ? std::floor(255 * share + 0.5) / 255 : share; };
  Doubles stored;
  for (size_t f = 0; f < features.size(); ++f) {
    const double low = ranges[2 * f], high = ranges[2 * f + 1];
    stored.push_back(low);
    if (high > low) stored.back() += (high - low) * toByte((std::clamp(features[f], low, high) - low) / (high - low));
  }
  double opacity = 1 / (1 + std::exp(-features[0] - a.offset));
  if (rounds) opacity = opacity >= a.opaqueFrom ? 1 : opacity < a.transparentBelow ? 0 : toByte(opacity);
  stored.push_back(opacity);
  return stored;
}

namespace {

// Calls call(sample, row, weight) for every row that exists and has a weight.
template <class Arguments, class Call>
void forMixedRows(const Arguments& a, const Call& call) {
  const size_t count = size_t{a.perSample} * hostCount(a.samples);
  const Indices rows = indices(a.rows, count);
  const Doubles weights = doubles(a.weights, count);
  const uint32_t end = hostCount(a.inputRows);
  for (size_t i = 0; i < count; ++i)
    if (rows[i] < end && weights[i] != 0) call(i / a.perSample, rows[i], weights[i]);
}

}  // namespace

void run(const PatchTexels& a) {
  const size_t samples = hostCount(a.samples);
  const Indices faces = indices(a.faces, samples), places = indices(a.patchOfFace, a.patchOfFace.count);
  const Doubles barycentrics = doubles(a.barycentrics, 2 * samples),
                factors = doubles(a.cornerFactors, a.cornerFactors.count);
  std::vector<uint32_t> texels(4 * samples);
  Doubles weights(4 * samples);
  for (size_t s = 0; s < samples; ++s) {
    const uint32_t place = places[faces[s]];
    if (place == kNoPatch) continue;
    const double second = barycentrics[2 * s], third = barycentrics[2 * s + 1];
    const View factorsOfPatch = factors.empty() ? View() : View(factors).subspan(size_t{4} * (place / 16), 4);
    const auto around = patchTexels(a.patchEdge, place, {1 - second - third, second, third}, factorsOfPatch);
    for (size_t k = 0; k < 4; ++k) {
      texels[4 * s + k] = around[k].number;
      weights[4 * s + k] = around[k].weight;
    }
  }
  store(a.texels, texels);
  store(a.weights, weights);
}

void run(const DistinctRows& a) {
  const Indices ids = indices(a.ids, size_t{a.perSample} * hostCount(a.samples));
  std::map<uint32_t, uint32_t> rowOfId;
  for (const uint32_t id : ids)
    if (id < a.idCount) rowOfId[id] = 0;
  std::vector<uint32_t> marks(a.words()), ranks(a.words()), rowIds;
  uint32_t next = 0;
  for (auto& [id, row] : rowOfId) {
    row = next++;
    marks[id / 32] |= 1u << id % 32;
    if (row < a.rowCapacity) rowIds.push_back(id);
  }
  for (size_t word = 0; word < ranks.size(); ++word) {
    const auto first = rowOfId.lower_bound(static_cast<uint32_t>(32 * word));
    ranks[word] = first == rowOfId.end() ? next : first->second;
  }
  std::vector<uint32_t> rows;
  for (const uint32_t id : ids) {
    const auto place = rowOfId.find(id);
    rows.push_back(place == rowOfId.end() || place->second >= a.rowCapacity ? kNoRow : place->second);
  }
  store(a.marks, marks);
  store(a.ranks, ranks);
  store(a.rowCount, std::vector<uint32_t>{next});
  store(a.rowIds, rowIds);
  store(a.rows, rows);
}

void run(const StoreTexelsForward& a) {
  const size_t rows = hostCount(a.rows);
  CHECK(a.features.columns == StoreTexelsForward::kFeatures);
  CHECK(a.stored.columns == StoreTexelsForward::kStored);
  const Doubles features = doubles(a.features, rows), ranges = doubles(a.ranges, 2 * StoreTexelsForward::kFeatures);
  Doubles all;
  for (size_t row = 0; row < rows; ++row) {
    const View one = View(features).subspan(row * StoreTexelsForward::kFeatures, StoreTexelsForward::kFeatures);
    const Doubles stored = storedTexel(a, ranges, one);
    all.insert(all.end(), stored.begin(), stored.end());
  }
  store(a.stored, all);
}

void run(const StoreTexelsBackward& a) {
  constexpr size_t kFeatures = StoreTexelsForward::kFeatures, kStored = StoreTexelsForward::kStored;
  const size_t rows = hostCount(a.rows);
  CHECK(a.features.columns == kFeatures);
  CHECK(a.storedGradients.columns == kStored);
  CHECK(a.featureGradients.columns == kFeatures);
  const Doubles features = doubles(a.features, rows), ranges = doubles(a.ranges, 2 * kFeatures);
  const Doubles upstream = doubles(a.storedGradients, rows);
  Doubles gradients(kFeatures * rows);
  for (size_t i = 0; i < gradients.size(); ++i) {
    const size_t row = i / kFeatures, f = i % kFeatures;
    const double x = features[i];
    if (ranges[2 * f] <= x && x <= ranges[2 * f + 1]) gradients[i] = upstream[kStored * row + f];
    if (f > 0) continue;
    const double opacity = 1 / (1 + std::exp(-x - a.offset));
    gradients[i] += upstream[kStored * row + kFeatures] * opacity * (1 - opacity);
  }
  store(a.featureGradients, gradients);
}

void run(const MixRowsForward& a) {
  const size_t columns = a.output.columns;
  CHECK(a.input.columns == columns);
  const Doubles input = doubles(a.input, hostCount(a.inputRows));
  Doubles output(columns * hostCount(a.samples));
  forMixedRows(a, [&](size_t s, size_t row, double weight) {
    for (size_t c = 0; c < columns; ++c) output[columns * s + c] += weight * input[columns * row + c];
  });
  store(a.output, output);
}

void run(const MixRowsBackward& a) {
  const size_t columns = a.inputGradients.columns;
  CHECK(a.outputGradients.columns == columns);
  const Doubles upstream = doubles(a.outputGradients, hostCount(a.samples));
  Doubles sums = doubles(Matrix<const float>(a.inputGradients), hostCount(a.inputRows));
  forMixedRows(a, [&](size_t s, size_t row, double weight) {
    for (size_t c = 0; c < columns; ++c) sums[columns * row + c] += weight * upstream[columns * s + c];
  });
  store(a.inputGradients, sums);
}

}  // namespace tessera::reference
