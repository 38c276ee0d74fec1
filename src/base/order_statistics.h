// Medians and percentiles.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "base/check.h"

namespace tessera {

// Returns the value that `rank` of the values precede by size. Reorders the values.
template <typename T>
T valueOfRank(std::vector<T>& values, size_t rank) {
  CHECK(rank < values.size());
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank), values.end());
  return values[rank];
}

// Returns the value below which that share of the others lies, rounded down. There must be some. Reorders the values.
template <typename T>
T percentile(std::vector<T>& values, double share) {
  CHECK(values.size() > 0u);
  return valueOfRank(values, static_cast<size_t>(share * static_cast<double>(values.size() - 1)));
}

// Returns the middle of the values by size, of two the larger. There must be some. Reorders the values.
template <typename T>
T upperMedian(std::vector<T>& values) {
  return valueOfRank(values, values.size() / 2);
}

}  // namespace tessera
