// What a setting may be.
#pragma once

#include <initializer_list>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

namespace tessera {

// They may depend on other settings' values, and hold for the values that these had when the bounds were made.
struct ConfigBounds {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  bool isBounded = false;                 // by low and high, which are allowed; then no NaN is
  int divisor = 1, rounding = 0;          // multiples of it alone; `rounding` is added to round down to one to suggest
  std::vector<int> sizes;                 // if not empty: one of these
  std::vector<std::string_view> choices;  // if not empty: one of these
  bool isDependent = false;               // on other settings: is checked after those that are not

  static constexpr double kTiny = 1e-12, kHuge = 1e12;  // for what must be positive, and what must be finite

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
  static ConfigBounds oneOf(std::initializer_list<int> sizes) {
    ConfigBounds bounds;
    bounds.sizes = sizes;
    return bounds;
  }
  static ConfigBounds oneOf(std::initializer_list<std::string_view> choices) {
    ConfigBounds bounds;
    bounds.choices = choices;
    return bounds;
  }
  ConfigBounds inMultiplesOf(int number, int suggestedRounding) && {
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
