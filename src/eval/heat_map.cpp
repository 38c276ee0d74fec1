#include "eval/heat_map.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.h"

namespace tessera {
namespace {

using Colour = std::array<uint8_t, 3>;

// Samples at equal steps of the colour maps by Smith, van der Walt and Firing (matplotlib, CC0), interpolated linearly.
constexpr Colour kInferno[] = {{0, 0, 4},     {27, 12, 65},   {74, 12, 107}, {120, 28, 109}, {165, 44, 96},
                               {207, 68, 70}, {237, 105, 37}, {251, 155, 6}, {247, 209, 61}, {252, 255, 164}};
constexpr Colour kViridis[] = {{68, 1, 84},    {72, 40, 120},  {62, 73, 137},  {49, 104, 142}, {38, 130, 142},
                               {31, 158, 137}, {53, 183, 121}, {110, 206, 88}, {181, 222, 43}, {253, 231, 37}};

}  // namespace

std::array<uint8_t, 3> evaluateColourMap(ColourMap map, float t) {
  if (std::isnan(t)) return {128, 128, 128};
  const std::span<const Colour> anchors = map == ColourMap::inferno ? std::span(kInferno) : std::span(kViridis);
  const float position = std::clamp(t, 0.0f, 1.0f) * static_cast<float>(anchors.size() - 1);
  const size_t below = std::min(static_cast<size_t>(position), anchors.size() - 2);
  const float share = position - static_cast<float>(below);
  Colour colour;
  for (size_t c = 0; c < 3; ++c) {
    colour[c] = static_cast<uint8_t>((1 - share) * anchors[below][c] + share * anchors[below + 1][c] + 0.5f);
  }
  return colour;
}

ImageU8 heatMap(const ImageF& values, float low, float high, ColourMap map) {
  CHECK(values.channels == 1);
  ImageU8 image(values.width, values.height, 3);
  const float scale = high > low ? 1 / (high - low) : 0;
  for (size_t i = 0; i < values.pixels.size(); ++i) {
    const Colour colour = evaluateColourMap(map, (values.pixels[i] - low) * scale);
    std::copy(colour.begin(), colour.end(), image.pixels.begin() + static_cast<std::ptrdiff_t>(3 * i));
  }
  return image;
}

ImageF absoluteDifference(const ImageF& a, const ImageF& b) {
  CHECK(a.width == b.width);
  CHECK(a.height == b.height);
  CHECK(a.channels == b.channels);
  ImageF difference(a.width, a.height, 1);
  for (size_t p = 0; p < difference.pixels.size(); ++p) {
    float sum = 0;
    for (int c = 0; c < a.channels; ++c) sum += std::abs(a.pixels[p * a.channels + c] - b.pixels[p * a.channels + c]);
    difference.pixels[p] = sum / static_cast<float>(a.channels);
  }
  return difference;
}

}  // namespace tessera
