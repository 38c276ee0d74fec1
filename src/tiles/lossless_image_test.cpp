#include "tiles/lossless_image.h"

#include <gtest/gtest.h>
#include <webp/encode.h>

#include "base/random.h"

namespace tessera {
namespace {

ImageU8 noise(int width, int height) {
  ImageU8 image(width, height, 3);
  const RandomStream random(1, 2);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<uint8_t>(random.below(i, 256));
  return image;
}

TEST(LosslessImage, RoundTripsEveryPixel) {
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {64, 64}, {kLargestLosslessSide, 1}}) {
    const ImageU8 image = noise(width, height);
    const auto again = decodeLossless(encodeLossless(image), width, height);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->pixels, image.pixels);
  }
}

TEST(LosslessImage, GivesTheSameBytesAgain) {
  const ImageU8 image = noise(40, 30);
  EXPECT_EQ(encodeLossless(image), encodeLossless(image));
}

TEST(LosslessImage, RefusesAnotherSize) {
  const Bytes bytes = encodeLossless(noise(8, 9));
  EXPECT_TRUE(decodeLossless(bytes, 8, 9));
  EXPECT_FALSE(decodeLossless(bytes, 9, 8));
  EXPECT_FALSE(decodeLossless(bytes, 8, 10));
  EXPECT_FALSE(decodeLossless(bytes, 0, 0));
}

TEST(LosslessImage, RejectsATruncatedImage) {
  const Bytes bytes = encodeLossless(noise(32, 32));
  for (const size_t length : {size_t{0}, size_t{11}, size_t{20}, bytes.size() / 2, bytes.size() - 8}) {
    EXPECT_FALSE(decodeLossless(std::span(bytes).first(length), 32, 32)) << length;
  }
}

TEST(LosslessImage, RefusesLossAndAlpha) {
  std::vector<uint8_t> pixels(16 * 16 * 4, 77);
  uint8_t* encoded = nullptr;
  const auto takeEncodedBytes = [&](size_t size) {
    const auto* start = reinterpret_cast<const std::byte*>(encoded);
    Bytes bytes(start, start + size);
    WebPFree(encoded);
    return bytes;
  };
  const Bytes lossy = takeEncodedBytes(WebPEncodeRGB(pixels.data(), 16, 16, 48, 90, &encoded));
  ASSERT_FALSE(lossy.empty());
  EXPECT_FALSE(decodeLossless(lossy, 16, 16));
  const Bytes transparent = takeEncodedBytes(WebPEncodeLosslessRGBA(pixels.data(), 16, 16, 64, &encoded));
  ASSERT_FALSE(transparent.empty());
  EXPECT_FALSE(decodeLossless(transparent, 16, 16));
}

}  // namespace
}  // namespace tessera
