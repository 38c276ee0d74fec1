#include "gpu/free_ranges.h"

#include <gtest/gtest.h>

#include <map>

#include "base/random.h"

namespace tessera {
namespace {

TEST(FreeRanges, AllocateTheFirstRangeThatFits) {
  FreeRanges ranges(100);
  EXPECT_EQ(ranges.take(40), 0u);
  EXPECT_EQ(ranges.take(40), 40u);
  EXPECT_EQ(ranges.take(40), std::nullopt);
  ranges.giveBack(0, 40);
  EXPECT_EQ(ranges.take(10), 0u);
  EXPECT_EQ(ranges.take(20), 10u);
  EXPECT_EQ(ranges.take(20), 80u);
}

TEST(FreeRanges, MergeAdjacentRanges) {
  FreeRanges ranges(90);
  for (int i = 0; i < 3; ++i) ranges.take(30);
  ranges.giveBack(0, 30);
  ranges.giveBack(60, 30);
  EXPECT_EQ(ranges.take(60), std::nullopt);
  EXPECT_FALSE(ranges.allFree());
  ranges.giveBack(30, 30);
  EXPECT_TRUE(ranges.allFree());
  EXPECT_EQ(ranges.take(90), 0u);
}

TEST(FreeRanges, NeverOverlapAndMergeCompletely) {
  constexpr size_t kSize = 1000;
  FreeRanges ranges(kSize);
  const RandomStream random(1, 1);
  std::map<size_t, size_t> taken;
  for (uint64_t i = 0; i < 20000; ++i) {
    if (random.below(2 * i, 2) == 0 || taken.empty()) {
      const size_t bytes = 1 + random.below(2 * i + 1, 60);
      const auto at = ranges.take(bytes);
      if (!at) continue;
      const auto next = taken.lower_bound(*at);
      ASSERT_TRUE(next == taken.end() || *at + bytes <= next->first);
      ASSERT_TRUE(next == taken.begin() || std::prev(next)->first + std::prev(next)->second <= *at);
      ASSERT_LE(*at + bytes, kSize);
      taken[*at] = bytes;
    } else {
      auto which = std::next(taken.begin(), random.below(2 * i + 1, static_cast<uint32_t>(taken.size())));
      ranges.giveBack(which->first, which->second);
      taken.erase(which);
    }
  }
  for (const auto& [offset, bytes] : taken) ranges.giveBack(offset, bytes);
  EXPECT_TRUE(ranges.allFree());
}

}  // namespace
}  // namespace tessera
