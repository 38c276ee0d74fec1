#include "render/tile_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/random.h"
#include "render/testing/test_tree.h"

namespace tessera {
namespace {

struct FakeContent {
  uint64_t bytes = 0;
  uint64_t memoryBytes() const { return bytes; }
};

constexpr uint64_t kBytes = 2000;

std::unique_ptr<FakeContent> contentOfBytes(uint64_t bytes) {
  return std::make_unique<FakeContent>(FakeContent{bytes});
}

TileSource<FakeContent> makeTileSource(std::function<std::unique_ptr<FakeContent>(int)> load) {
  TileSource<FakeContent> source;
  source.bytes = [](int) { return kBytes; };
  source.load = std::move(load);
  return source;
}

TEST(TileCache, NeverHoldsMoreThanItsBudgetUnderRandomAccess) {
  const TileTree tree = testTree(4, 4);
  const RandomStream random(1, 1);
  for (const uint64_t budget : {kBytes, 3 * kBytes, 7 * kBytes + 5, 100 * kBytes}) {
    uint64_t loads = 0;
    TileCache<FakeContent> cache(tree, budget, makeTileSource([&](int) {
                                   ++loads;
                                   return contentOfBytes(kBytes);
                                 }));
    uint64_t expectedHits = 0;
    for (uint64_t i = 0; i < 3000; ++i) {
      std::vector<int> tiles;
      for (uint64_t k = 0; k <= random.below(10 * i, 4) && (tiles.size() + 2) * kBytes <= budget; ++k) {
        const int tile = 1 + static_cast<int>(random.below(10 * i + 1 + k, 20));
        if (std::find(tiles.begin(), tiles.end(), tile) == tiles.end()) tiles.push_back(tile);
      }
      cache.load(tiles);
      for (const int tile : tiles) expectedHits += cache.find(tile) != nullptr;
      ASSERT_TRUE(std::all_of(tiles.begin(), tiles.end(), [&](int tile) { return cache.holds(tile); }));
      ASSERT_TRUE(cache.holds(0));  // the coarsest level
      ASSERT_LE(cache.statistics().bytes, budget);
      ASSERT_LE(cache.statistics().maxBytes, budget);
    }
    EXPECT_EQ(cache.statistics().loads, loads);
    EXPECT_EQ(cache.statistics().hits, expectedHits);
    EXPECT_EQ(cache.statistics().loads - cache.statistics().evictions, cache.statistics().bytes / kBytes);
    if (budget == 100 * kBytes) {
      EXPECT_EQ(loads, 21u);
    }
    if (budget == kBytes) {
      EXPECT_EQ(loads, 1u);
    }
  }
}

TEST(TileCache, EvictsTheLeastRecentlyUsedAndOnlyWhenNeeded) {
  const TileTree tree = testTree(4, 4);
  TileCache<FakeContent> cache(tree, 4 * kBytes, makeTileSource([](int) { return contentOfBytes(kBytes); }));
  cache.load(std::vector<int>{1, 2, 3});
  cache.load({});
  EXPECT_EQ(cache.statistics().evictions, 0u);
  cache.find(1);
  cache.load(std::vector<int>{4});
  EXPECT_FALSE(cache.holds(2));
  cache.load(std::vector<int>{5, 3});
  EXPECT_TRUE(cache.holds(3));
  EXPECT_FALSE(cache.holds(1));
  EXPECT_EQ(cache.find(1), nullptr);
}

TEST(TileCache, ReportsHowMuchTheCoarsestLevelAndTheBackgroundBlockNeed) {
  TileTree tree = testTree(2, 2);
  tree.backgroundBlock = static_cast<int>(tree.tiles.size());
  tree.tiles.emplace_back().isBackgroundBlock = true;
  int loads = 0;
  const TileSource<FakeContent> source = makeTileSource([&](int) {
    ++loads;
    return contentOfBytes(kBytes);
  });
  TileSource<FakeContent> named = source;
  named.folder = "site.scene";
  try {
    TileCache(tree, 2 * kBytes - 1, named);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), "site.scene");
    EXPECT_NE(std::string(error.what()).find("4000 bytes"), std::string::npos) << error.what();
  }
  EXPECT_EQ(loads, 0);
  const TileCache<FakeContent> cache(tree, 2 * kBytes, source);
  EXPECT_TRUE(cache.holds(tree.backgroundBlock));
  EXPECT_TRUE(cache.holds(0));
}

TEST(TileCache, RejectsAContentThatIsLargerThanItsSourceDeclared) {
  const TileTree tree = testTree(2, 2);
  TileSource<FakeContent> source =
      makeTileSource([](int tile) { return contentOfBytes(kBytes + (tile == 2 ? 1 : 0)); });
  source.file = [](int tile) { return std::to_string(tile) + ".glb"; };
  TileCache<FakeContent> cache(tree, 100 * kBytes, source);
  try {
    cache.load(std::vector<int>{1, 2});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), "2.glb");
  }
  EXPECT_TRUE(cache.holds(1));
  EXPECT_FALSE(cache.holds(2));
  EXPECT_EQ(cache.statistics().bytes, 2 * kBytes);
}

// Tile t needs resource t % 2, and the root needs none; a resource is as large as a content.
TEST(TileCache, ChargesASharedResourceOnceAndOnlyWhileAContentNeedsIt) {
  const TileTree tree = testTree(4, 4);
  TileSource<FakeContent> source = makeTileSource([](int) { return contentOfBytes(kBytes); });
  source.tileResources = [](int tile) { return tile == 0 ? std::vector<int>{} : std::vector<int>{tile % 2}; };
  source.bytesOfResource = [](int) { return kBytes; };
  TileCache<FakeContent> cache(tree, 5 * kBytes, source);
  EXPECT_EQ(cache.statistics().bytes, kBytes);
  cache.load(std::vector<int>{1});
  EXPECT_EQ(cache.statistics().bytes, 3 * kBytes);  // includes the resource
  cache.load(std::vector<int>{3});
  EXPECT_EQ(cache.statistics().bytes, 4 * kBytes);  // the resource is shared
  cache.load(std::vector<int>{5});
  EXPECT_EQ(cache.statistics().bytes, 5 * kBytes);
  EXPECT_EQ(cache.statistics().evictions, 0u);
  // A tile that needs the other resource takes the space of two contents.
  cache.load(std::vector<int>{2});
  EXPECT_EQ(cache.statistics().evictions, 2u);
  EXPECT_FALSE(cache.holds(1));
  EXPECT_FALSE(cache.holds(3));
  EXPECT_EQ(cache.statistics().bytes, 5 * kBytes);
  // The first resource is evicted with its last content.
  cache.load(std::vector<int>{2, 4, 6});
  EXPECT_FALSE(cache.holds(5));
  EXPECT_EQ(cache.statistics().bytes, 5 * kBytes);  // the root, three contents and their resource
  EXPECT_LE(cache.statistics().maxBytes, 5 * kBytes);
}

TEST(TileCache, CountsTheResourcesOfPinnedTiles) {
  TileTree tree = testTree(2, 2);
  tree.backgroundBlock = static_cast<int>(tree.tiles.size());
  tree.tiles.emplace_back().isBackgroundBlock = true;
  TileSource<FakeContent> source = makeTileSource([](int) { return contentOfBytes(kBytes); });
  source.tileResources = [](int) { return std::vector<int>{7}; };
  source.bytesOfResource = [](int) { return kBytes; };
  EXPECT_THROW(TileCache<FakeContent>(tree, 3 * kBytes - 1, source), Error);
  EXPECT_EQ(TileCache<FakeContent>(tree, 3 * kBytes, source).statistics().bytes, 3 * kBytes);
}

}  // namespace
}  // namespace tessera
