// Checks of single settings: an Error that names the setting and what it may be.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <initializer_list>

#include "base/error.h"

namespace tessera {

// Also an Error for what is not a number.
inline void requireWithin(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  throw Error(fmt::format("--set {}={}", name, value), "", "is out of range",
              fmt::format("use {} from {} to {}", name, low, high));
}

inline void requireOneOf(const char* name, int value, std::initializer_list<int> allowed) {
  if (std::find(allowed.begin(), allowed.end(), value) != allowed.end()) return;
  throw Error(fmt::format("--set {}={}", name, value), "", "is none of the sizes there are",
              fmt::format("use one of {}", fmt::join(allowed, ", ")));
}

}  // namespace tessera
