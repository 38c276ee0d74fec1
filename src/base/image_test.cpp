#include "base/image.h"

#include <gtest/gtest.h>

#include <limits>

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

}  // namespace
}  // namespace tessera
