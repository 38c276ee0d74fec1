#include "base/image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"

namespace tessera {
namespace {

TEST(Image, ConvertsBytesToFloatsAndBackWithoutLoss) {
  ImageU8 all(256, 1, 1);
  for (int i = 0; i < 256; ++i) all.pixels[static_cast<size_t>(i)] = static_cast<uint8_t>(i);
  const ImageF floats = toFloat(all);
  EXPECT_EQ(floats.pixels.front(), 0.0f);
  EXPECT_EQ(floats.pixels.back(), 1.0f);
  EXPECT_EQ(toBytes(floats).pixels, all.pixels);
}

TEST(Image, ClampsAndRoundsToNearest) {
  ImageF image(6, 1, 1);
  image.pixels = {
      -1.0f, 2.0f, 0.5f, 0.9981f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()};
  EXPECT_EQ(toBytes(image).pixels, (std::vector<uint8_t>{0, 255, 128, 255, 0, 255}));
}

TEST(DownscaleByArea, AveragesWholeBlocks) {
  ImageU8 image(4, 2, 1);
  image.pixels = {0,  10, 100, 104,  //
                  20, 30, 108, 112};
  EXPECT_EQ(downscaleByArea(image, 2, 1).pixels, (std::vector<uint8_t>{15, 106}));
}

TEST(DownscaleByArea, WeighsPartlyCoveredPixels) {
  ImageF image(3, 1, 1);
  image.pixels = {1, 2, 4};  // the middle pixel falls half into each target: (1 + 2/2)/1.5 and (2/2 + 4)/1.5
  const ImageF half = downscaleByArea(image, 2, 1);
  EXPECT_FLOAT_EQ(half.pixels[0], 2.0f / 1.5f);
  EXPECT_FLOAT_EQ(half.pixels[1], 5.0f / 1.5f);
}

TEST(DownscaleByArea, KeepsTheMeanAndConstants) {
  ImageF image(37, 23, 3);
  const RandomStream random(1, 1);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = random.uniform(i);
  const ImageF small = downscaleByArea(image, 11, 7);
  double before = 0, after = 0;
  for (const float value : image.pixels) before += value;
  for (const float value : small.pixels) after += value;
  EXPECT_NEAR(before / (37 * 23), after / (11 * 7), 1e-5);
  for (const uint8_t value : downscaleByArea(ImageU8(37, 23, 3, 201), 5, 22).pixels) EXPECT_EQ(value, 201);
}

TEST(DownscaleByArea, ReturnsTheSamePictureForTheSameSize) {
  ImageU8 image(2, 2, 1);
  image.pixels = {1, 2, 3, 4};
  EXPECT_EQ(downscaleByArea(image, 2, 2).pixels, image.pixels);
}

TEST(DownscaleByAreaDeathTest, RefusesToEnlarge) {
  EXPECT_DEATH(downscaleByArea(ImageU8(2, 2, 1), 3, 2), "width <= image.width");
}

// Rows of letters, one for each pixel.
ImageU8 letters(const std::vector<std::string>& rows) {
  ImageU8 image(static_cast<int>(rows[0].size()), static_cast<int>(rows.size()), 1);
  for (size_t y = 0; y < rows.size(); ++y) std::copy(rows[y].begin(), rows[y].end(), image.at(0, static_cast<int>(y)));
  return image;
}

std::vector<std::string> rows(const ImageU8& image) {
  std::vector<std::string> rows;
  for (int y = 0; y < image.height; ++y) rows.emplace_back(image.at(0, y), image.at(0, y) + image.width);
  return rows;
}

TEST(TurnUpright, FollowsEachOrientationOfExif) {
  // What a viewer must show, of which cameras store the following.
  const std::vector<std::string> upright = {"abc", "def"};
  const std::vector<std::pair<int, std::vector<std::string>>> stored = {
      {1, {"abc", "def"}},     {2, {"cba", "fed"}},     {3, {"fed", "cba"}},     {4, {"def", "abc"}},
      {5, {"ad", "be", "cf"}}, {6, {"cf", "be", "ad"}}, {7, {"fc", "eb", "da"}}, {8, {"da", "eb", "fc"}}};
  for (const auto& [orientation, picture] : stored)
    EXPECT_EQ(rows(turnUpright(letters(picture), orientation)), upright) << orientation;
  for (const int unknown : {0, 9, -1}) EXPECT_EQ(rows(turnUpright(letters(upright), unknown)), upright) << unknown;
}

}  // namespace
}  // namespace tessera
