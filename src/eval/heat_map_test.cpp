#include "eval/heat_map.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

using Colour = std::array<uint8_t, 3>;

TEST(HeatMap, RunsFromDarkToBright) {
  for (const ColourMap map : {ColourMap::inferno, ColourMap::viridis}) {
    int before = -1;
    for (int i = 0; i <= 100; ++i) {
      const Colour colour = evaluateColourMap(map, static_cast<float>(i) / 100);
      const int luma = 299 * colour[0] + 587 * colour[1] + 114 * colour[2];
      EXPECT_GT(luma, before) << i;
      before = luma;
    }
  }
}

TEST(HeatMap, ClampsValuesAndShowsNaNAsGrey) {
  EXPECT_EQ(evaluateColourMap(ColourMap::inferno, -3), (Colour{0, 0, 4}));
  EXPECT_EQ(evaluateColourMap(ColourMap::inferno, 7), (Colour{252, 255, 164}));
  EXPECT_EQ(evaluateColourMap(ColourMap::viridis, std::nanf("")), (Colour{128, 128, 128}));
  EXPECT_EQ(evaluateColourMap(ColourMap::viridis, INFINITY), (Colour{253, 231, 37}));
}

TEST(HeatMap, StretchesTheGivenRange) {
  ImageF values(3, 1, 1);
  values.pixels = {10, 15, 20};
  const ImageU8 image = heatMap(values, 10, 20, ColourMap::viridis);
  EXPECT_EQ(image.at(0, 0)[0], 68);
  EXPECT_EQ(image.at(2, 0)[0], 253);
  EXPECT_EQ(image.at(1, 0)[1], evaluateColourMap(ColourMap::viridis, 0.5f)[1]);
}

TEST(HeatMap, AveragesTheDifferenceOverChannels) {
  ImageF a(1, 1, 3), b(1, 1, 3);
  a.pixels = {0.5f, 0.5f, 0.5f};
  b.pixels = {0.2f, 0.8f, 0.5f};
  EXPECT_NEAR(absoluteDifference(a, b).pixels[0], 0.2f, 1e-6f);
}

}  // namespace
}  // namespace tessera
