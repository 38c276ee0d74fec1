// One number per pixel as colour.
#pragma once

#include <array>
#include <cstdint>

#include "base/image.h"

namespace tessera {

enum class ColourMap {
  inferno,  // black, purple, red, yellow, white: errors
  viridis   // blue, green, yellow: depths
};

// The mean absolute difference at which every error map is brightest, so that maps can be compared.
inline constexpr float kBrightestError = 0.25f;

// t in [0, 1], clamped; NaN is grey.
std::array<uint8_t, 3> colourOf(ColourMap map, float t);

// `values`: 1 channel; low and high become the ends of the map.
ImageU8 heatMap(const ImageF& values, float low, float high, ColourMap map);

// Mean over channels of |a − b|: 1 channel.
ImageF absoluteDifference(const ImageF& a, const ImageF& b);

}  // namespace tessera
