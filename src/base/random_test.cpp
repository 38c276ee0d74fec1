#include "base/random.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace tessera {
namespace {

TEST(Random, IsAFunctionOfSeedStreamAndIndexAlone) {
  const RandomStream a(7, 3), b(7, 3), otherStream(7, 4), otherSeed(8, 3);
  EXPECT_EQ(a.bits(12), b.bits(12));
  EXPECT_NE(a.bits(12), a.bits(13));
  EXPECT_NE(a.bits(12), otherStream.bits(12));
  EXPECT_NE(a.bits(12), otherSeed.bits(12));
}

TEST(Random, KeepsItsNumbersBetweenVersions) {  // checkpoints and generated captures depend on them
  EXPECT_EQ(mix64(0), 0xe220a8397b1dcdafull);   // SplitMix64's first output from state 0
  EXPECT_EQ(mix64(0x9e3779b97f4a7c15ull), 0x6e789e6aa1b965f4ull);
}

TEST(Random, IsUniformInTheUnitInterval) {
  const RandomStream stream(1, 2);
  constexpr int kCount = 100000, kBins = 16;
  std::array<int, kBins> bins{};
  double sum = 0;
  for (uint64_t i = 0; i < kCount; ++i) {
    const float value = stream.uniform(i);
    ASSERT_GE(value, 0.0f);
    ASSERT_LT(value, 1.0f);
    sum += value;
    ++bins[static_cast<size_t>(value * kBins)];
  }
  EXPECT_NEAR(sum / kCount, 0.5, 5 * std::sqrt(1.0 / 12 / kCount));
  double chiSquare = 0;
  for (const int bin : bins) chiSquare += std::pow(bin - kCount / kBins, 2) / (kCount / kBins);
  EXPECT_LT(chiSquare, 44.3);  // 15 degrees of freedom, p = 1e-4
}

TEST(Random, HasNoCorrelationBetweenNeighbouringIndicesOrStreams) {
  constexpr int kCount = 50000;
  const RandomStream a(5, 0), b(5, 1);
  double lagged = 0, across = 0;
  for (uint64_t i = 0; i < kCount; ++i) {
    lagged += (a.uniform(i) - 0.5) * (a.uniform(i + 1) - 0.5);
    across += (a.uniform(i) - 0.5) * (b.uniform(i) - 0.5);
  }
  const double bound = 5.0 / 12 / std::sqrt(static_cast<double>(kCount));
  EXPECT_LT(std::abs(lagged / kCount), bound);
  EXPECT_LT(std::abs(across / kCount), bound);
}

TEST(Random, StaysBelowItsBoundAndReachesEveryValue) {
  const RandomStream stream(9, 9);
  std::array<int, 6> counts{};
  for (uint64_t i = 0; i < 6000; ++i) ++counts.at(stream.below(i, 6));
  for (const int count : counts) EXPECT_NEAR(count, 1000, 150);
  EXPECT_EQ(stream.below(0, 1), 0u);
}

TEST(Random, GivesDoublesInTheUnitInterval) {
  const RandomStream stream(2, 2);
  double sum = 0;
  for (uint64_t i = 0; i < 10000; ++i) {
    const double value = stream.uniformDouble(i);
    ASSERT_GE(value, 0.0);
    ASSERT_LT(value, 1.0);
    sum += value;
  }
  EXPECT_NEAR(sum / 10000, 0.5, 0.015);
}

}  // namespace
}  // namespace tessera
