// Colour maps of images with one number per pixel.
#pragma once

#include <array>
#include <cstdint>

#include "base/image.h"

namespace tessera {

enum class ColourMap {
  inferno,  // black, purple, red, yellow, white: errors
  viridis   // blue, green, yellow: depths
};

// The mean absolute difference that maps to the brightest colour in all error maps, so that they can be compared.
inline constexpr float kBrightestError = 0.25f;

// Returns the colour of t, clamped to [0, 1]; grey for NaN.
std::array<uint8_t, 3> evaluateColourMap(ColourMap map, float t);

// Colours an image with 1 channel; `low` and `high` map to the ends of the colour map.
ImageU8 heatMap(const ImageF& values, float low, float high, ColourMap map);

// Returns the mean over channels of |a − b|, 1 channel.
ImageF absoluteDifference(const ImageF& a, const ImageF& b);

}  // namespace tessera
