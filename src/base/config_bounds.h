// The values that a setting may have.
#pragma once

#include <initializer_list>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

namespace tessera {

// Bounds may be computed from other settings' values; they are valid for the values that those settings had when the
// bounds were constructed.
struct ConfigBounds {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  bool isBounded = false;                 // by [low, high], which excludes NaN
  int divisor = 1, rounding = 0;          // multiples of divisor; errors suggest value + rounding, rounded down to one
  std::vector<int> sizes;                 // if not empty: one of these
  std::vector<std::string_view> choices;  // if not empty: one of these
  bool isDependent = false;               // depends on other settings: checked after those that do not

  static constexpr double kTiny = 1e-12, kHuge = 1e12;  // limits of values that must be positive or finite

  static ConfigBounds anything() { return {}; }
  static ConfigBounds within(double low, double high) {
    ConfigBounds bounds;
    bounds.low = low;
    bounds.high = high;
    bounds.isBounded = true;
    return bounds;
  }
  static ConfigBounds atLeast(double low) { return within(low, kHuge); }
  static ConfigBounds positive() { return atLeast(kTiny); }
  static ConfigBounds share() { return within(0, 1); }
  static ConfigBounds allowedValues(std::initializer_list<int> sizes) {
    ConfigBounds bounds;
    bounds.sizes = sizes;
    return bounds;
  }
  static ConfigBounds allowedValues(std::initializer_list<std::string_view> choices) {
    ConfigBounds bounds;
    bounds.choices = choices;
    return bounds;
  }
  ConfigBounds withDivisor(int number, int suggestedRounding) && {
    divisor = number;
    rounding = suggestedRounding;
    return std::move(*this);
  }
  ConfigBounds dependent() && {
    isDependent = true;
    return std::move(*this);
  }
};

}  // namespace tessera
