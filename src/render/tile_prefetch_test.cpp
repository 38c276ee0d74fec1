#include "render/tile_prefetch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <set>
#include <stdexcept>

namespace tessera {
namespace {

using std::chrono::milliseconds;

template <class Condition>
bool soon(Condition condition) {
  for (int i = 0; i < 5000 && !condition(); ++i) std::this_thread::sleep_for(milliseconds(1));
  return condition();
}

TEST(TilePrefetch, ReadsRequestedTilesWithoutBlocking) {
  TilePrefetch<int> prefetch([](int tile) { return 10 * tile; });
  prefetch.request({3, 1});
  ASSERT_TRUE(soon([&] { return prefetch.isReady(3) && prefetch.isReady(1); }));
  EXPECT_EQ(prefetch.take(3), 30);
  EXPECT_EQ(prefetch.take(1), 10);
  EXPECT_FALSE(prefetch.isReady(3));
}

TEST(TilePrefetch, ReadsTheMostUrgentFirstWithinItsCapacity) {
  std::mutex mutex;
  std::vector<int> order;
  TilePrefetch<int> prefetch(
      [&](int tile) {
        const std::lock_guard lock(mutex);
        order.push_back(tile);
        return tile;
      },
      1, 2);
  prefetch.request({5, 4, 3, 2});
  ASSERT_TRUE(soon([&] { return prefetch.isReady(4); }));
  std::this_thread::sleep_for(milliseconds(20));
  {
    const std::lock_guard lock(mutex);
    EXPECT_EQ(order, (std::vector<int>{5, 4}));
  }
  prefetch.request({5, 4, 2, 3});
  prefetch.take(5);
  ASSERT_TRUE(soon([&] { return prefetch.isReady(2); }));
  EXPECT_FALSE(prefetch.isReady(3));
}

TEST(TilePrefetch, DropsTilesThatAreNoLongerRequested) {
  std::atomic<bool> isBlocked = true;
  TilePrefetch<int> prefetch(
      [&](int tile) {
        while (tile == 1 && isBlocked) std::this_thread::sleep_for(milliseconds(1));
        return tile;
      },
      1);
  prefetch.request({1, 2});
  prefetch.request({2});  // 1 is being read
  isBlocked = false;
  ASSERT_TRUE(soon([&] { return prefetch.isReady(2); }));
  EXPECT_FALSE(prefetch.isReady(1));
  prefetch.request({});
  EXPECT_FALSE(prefetch.isReady(2));
}

TEST(TilePrefetch, RethrowsReadErrorsWhenTheContentIsTaken) {
  TilePrefetch<int> prefetch([](int tile) -> int { throw std::runtime_error("tile " + std::to_string(tile)); });
  prefetch.request({7});
  ASSERT_TRUE(soon([&] { return prefetch.isReady(7); }));
  EXPECT_THROW(prefetch.take(7), std::runtime_error);
  EXPECT_FALSE(prefetch.isReady(7));
  prefetch.request({7});  // reading is tried again
  ASSERT_TRUE(soon([&] { return prefetch.isReady(7); }));
}

TEST(TilePrefetch, SurvivesConstantlyChangingRequests) {
  std::set<int> taken;
  {
    TilePrefetch<int> prefetch([](int tile) { return tile; }, 3, 4);
    for (int i = 0; i < 2000; ++i) {
      prefetch.request({i % 7, (i + 3) % 7, (i + 5) % 7});
      for (int tile = 0; tile < 7; ++tile) {
        if (prefetch.isReady(tile)) taken.insert(prefetch.take(tile));
      }
    }
    for (int tile = 0; tile < 7; ++tile) {
      prefetch.request({tile});
      ASSERT_TRUE(soon([&] { return prefetch.isReady(tile); }));
      taken.insert(prefetch.take(tile));
    }
  }
  EXPECT_EQ(taken.size(), 7u);
}

}  // namespace
}  // namespace tessera
