#include "tiles/bc4.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace tessera {
namespace {

double squaredError(const Bc4Texels& texels, const Bc4Block& block) {
  double sum = 0;
  const std::array<float, 16> decoded = decodeBc4(block);
  for (size_t i = 0; i < texels.size(); ++i) sum += (decoded[i] - texels[i]) * (decoded[i] - texels[i]);
  return sum;
}

// Texels with values within a range, some of them 0 or 255 if `ends`.
Bc4Texels randomTexels(uint64_t seed, bool ends) {
  const RandomStream random(seed, 4);
  const int low = static_cast<int>(random.uniform(0) * 200), width = static_cast<int>(random.uniform(1) * (255 - low));
  Bc4Texels texels{};
  for (size_t i = 0; i < texels.size(); ++i) {
    const double at = random.uniform(2 + 2 * i), end = random.uniform(3 + 2 * i);
    texels[i] = static_cast<uint8_t>(low + at * width);
    if (ends && end < 0.2) texels[i] = end < 0.1 ? 0 : 255;
  }
  return texels;
}

TEST(Bc4, EncodesTheKnownBlock) {
  const Bc4Texels texels = {60, 80, 100, 120, 140, 160, 180, 200, 60, 60, 200, 200, 130, 131, 90, 70};
  const Bc4Block expected = {0xC8, 0x3C, 0xB9, 0xCB, 0x09, 0x09, 0x40, 0x3A};
  EXPECT_EQ(encodeBc4(texels, Bc4Effort::fast), expected);
  const std::array<float, 8> palette = bc4Palette(200, 60);
  for (int i = 0; i < 8; ++i)
    EXPECT_NEAR(palette[i], (std::array<float, 8>{200, 60, 180, 160, 140, 120, 100, 80}[i]), 1e-4);
  const std::array<float, 8> other = bc4Palette(50, 100);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(other[i], (std::array<float, 8>{50, 100, 60, 70, 80, 90, 0, 255}[i]), 1e-4);
}

TEST(Bc4, ErrsByAtMostAFourteenthOfTheRangeOfABlock) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const Bc4Texels texels = randomTexels(seed, false);
    const auto [low, high] = std::minmax_element(texels.begin(), texels.end());
    const std::array<float, 16> decoded = decodeBc4(encodeBc4(texels, Bc4Effort::fast));
    for (size_t i = 0; i < texels.size(); ++i)
      EXPECT_LE(std::abs(decoded[i] - texels[i]), (*high - *low) / 14.0 + 1e-4) << seed;
  }
}

TEST(Bc4, StoresOneValueExactly) {
  for (const int value : {0, 1, 77, 254, 255}) {
    Bc4Texels texels;
    texels.fill(static_cast<uint8_t>(value));
    for (const Bc4Effort effort : {Bc4Effort::fast, Bc4Effort::exhaustive})
      EXPECT_EQ(squaredError(texels, encodeBc4(texels, effort)), 0) << value;
  }
}

TEST(Bc4, ExhaustiveFindsThePairOfEndPointsOfLeastError) {
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const Bc4Texels texels = randomTexels(seed, seed % 2 == 1);
    double least = 1e30;
    for (int e0 = 0; e0 < 256; ++e0)
      for (int e1 = 0; e1 < 256; ++e1) {
        const std::array<float, 8> palette = bc4Palette(static_cast<uint8_t>(e0), static_cast<uint8_t>(e1));
        double sum = 0;
        for (const uint8_t texel : texels) {
          double nearest = 1e30;
          for (const float entry : palette) nearest = std::min(nearest, std::pow(double{entry} - texel, 2));
          sum += nearest;
        }
        least = std::min(least, sum);
      }
    const double error = squaredError(texels, encodeBc4(texels, Bc4Effort::exhaustive));
    EXPECT_LE(error, least + 1e-3) << seed;
    EXPECT_LE(error, squaredError(texels, encodeBc4(texels, Bc4Effort::fast)) + 1e-3) << seed;
  }
}

TEST(Bc4, KeepsWhatItDecoded) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const std::array<float, 16> decoded = decodeBc4(encodeBc4(randomTexels(seed, false), Bc4Effort::fast));
    Bc4Texels rounded;
    for (size_t i = 0; i < rounded.size(); ++i) rounded[i] = static_cast<uint8_t>(std::lround(decoded[i]));
    const std::array<float, 16> again = decodeBc4(encodeBc4(rounded, Bc4Effort::fast));
    for (size_t i = 0; i < again.size(); ++i) EXPECT_NEAR(again[i], decoded[i], 1) << seed;
  }
}

TEST(Bc4, DecodesASingleTexelAsInTheWholeBlock) {
  const RandomStream random(9, 4);
  int larger = 0;
  for (uint64_t i = 0; i < 400; ++i) {
    Bc4Block block;
    for (uint64_t byte = 0; byte < block.size(); ++byte)
      block[byte] = static_cast<uint8_t>(random.below(8 * i + byte, 256));
    if (i % 50 == 0) block[1] = block[0];
    larger += block[0] > block[1];
    const std::array<float, 16> whole = decodeBc4(block);
    for (uint32_t texel = 0; texel < 16; ++texel) EXPECT_NEAR(decodeBc4Texel(block.data(), texel), whole[texel], 1e-4);
  }
  EXPECT_GT(larger, 100) << "the palette of e0 > e1 is not tested";
  EXPECT_LT(larger, 300) << "the other palette is not tested";
}

TEST(Bc4, DividesAnImageIntoBlocksRowByRow) {
  std::vector<uint8_t> texels(8 * 12);
  for (size_t i = 0; i < texels.size(); ++i) texels[i] = static_cast<uint8_t>(i / 8 / 4 * 100 + i % 8 / 4 * 50);
  const std::vector<uint8_t> bytes = encodeBc4Image(texels, 8, 12, Bc4Effort::fast);
  ASSERT_EQ(bytes.size(), texels.size() / 2);
  for (size_t block = 0; block < 6; ++block) EXPECT_EQ(bytes[8 * block], block / 2 * 100 + block % 2 * 50);
}

TEST(Bc4, DecodesAnImageAsItsBlocks) {
  const RandomStream random(10, 4);
  std::vector<uint8_t> blocks;
  for (uint64_t i = 0; i < 8 * 6; ++i) blocks.push_back(static_cast<uint8_t>(random.below(i, 256)));
  const std::vector<uint8_t> texels = decodeBc4Image(blocks, 8, 12);
  ASSERT_EQ(texels.size(), 8u * 12);
  for (uint32_t y = 0; y < 12; ++y)
    for (uint32_t x = 0; x < 8; ++x) {
      const uint8_t* const block = blocks.data() + 8 * (x / 4 + 2 * (y / 4));
      EXPECT_NEAR(texels[8 * y + x], decodeBc4Texel(block, x % 4 + 4 * (y % 4)), 0.5001) << x << " " << y;
    }
}

}  // namespace
}  // namespace tessera
