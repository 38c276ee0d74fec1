#include "render/tile_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/random.h"
#include "render/made_tree.h"

namespace tessera {
namespace {

// A content of exactly so many bytes.
VolumeContent contentOfBytes(uint64_t bytes) {
  VolumeContent content;
  content.parts.resize(1);
  content.parts[0].voxelBytes.resize(bytes - bytesInMemory(content));
  return content;
}

constexpr uint64_t kBytes = 2000;

TileSource<VolumeContent> sourceOf(std::function<VolumeContent(int)> load) {
  return {[](int) { return kBytes; }, std::move(load)};
}

TEST(TileCache, CountsAllThatAContentHolds) {
  VolumeContent content;
  const uint64_t before = bytesInMemory(content);
  content.network = {{34, 3, std::vector<float>(102), std::vector<float>(3)}};
  EXPECT_EQ(bytesInMemory(content) - before, sizeof(DenseLayer) + 4 * 105);
  const uint64_t withNetwork = bytesInMemory(content);
  content.parts.resize(1);
  content.parts[0].macroblocks.resize(64);
  content.parts[0].voxelBytes.resize(5832);
  content.parts[0].planeBytes[2].resize(1000);
  content.parts[0].distances.resize(512);
  EXPECT_EQ(bytesInMemory(content) - withNetwork, sizeof(VolumePart) + 256 + 5832 + 1000 + 512);
}

TEST(TileCache, NeverHoldsMoreThanItsBudgetUnderRandomAccess) {
  const TileTree tree = madeTree(4, 4);
  const RandomStream random(1, 1);
  for (const uint64_t budget : {kBytes, 3 * kBytes, 7 * kBytes + 5, 100 * kBytes}) {
    uint64_t loads = 0;
    TileCache<VolumeContent> cache(tree, budget, sourceOf([&](int) {
                                     ++loads;
                                     return contentOfBytes(kBytes);
                                   }));
    uint64_t found = 0;
    for (uint64_t i = 0; i < 3000; ++i) {
      std::vector<int> tiles;
      for (uint64_t k = 0; k <= random.below(10 * i, 4) && (tiles.size() + 2) * kBytes <= budget; ++k) {
        const int tile = 1 + static_cast<int>(random.below(10 * i + 1 + k, 20));
        if (std::find(tiles.begin(), tiles.end(), tile) == tiles.end()) tiles.push_back(tile);
      }
      cache.load(tiles);
      for (const int tile : tiles) found += cache.find(tile) != nullptr;
      ASSERT_TRUE(std::all_of(tiles.begin(), tiles.end(), [&](int tile) { return cache.holds(tile); }));
      ASSERT_TRUE(cache.holds(0));  // the coarsest level
      ASSERT_LE(cache.statistics().bytes, budget);
      ASSERT_LE(cache.statistics().mostBytes, budget);
    }
    EXPECT_EQ(cache.statistics().loads, loads);
    EXPECT_EQ(cache.statistics().hits, found);
    EXPECT_EQ(cache.statistics().loads - cache.statistics().evictions, cache.statistics().bytes / kBytes);
    if (budget == 100 * kBytes) {
      EXPECT_EQ(loads, 21u);
    }
    if (budget == kBytes) {
      EXPECT_EQ(loads, 1u);
    }
  }
}

TEST(TileCache, EvictsWhatHasNotBeenUsedForLongestAndNothingWithoutNeed) {
  const TileTree tree = madeTree(4, 4);
  TileCache<VolumeContent> cache(tree, 4 * kBytes, sourceOf([](int) { return contentOfBytes(kBytes); }));
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

TEST(TileCache, SaysHowMuchTheCoarsestLevelAndTheSurroundNeed) {
  TileTree tree = madeTree(2, 2);
  tree.surround = static_cast<int>(tree.tiles.size());
  tree.tiles.emplace_back().isSurround = true;
  int loads = 0;
  const TileSource<VolumeContent> source = sourceOf([&](int) {
    ++loads;
    return contentOfBytes(kBytes);
  });
  TileSource<VolumeContent> named = source;
  named.folder = "site.scene";
  try {
    TileCache(tree, 2 * kBytes - 1, named);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), "site.scene");
    EXPECT_NE(std::string(error.what()).find("4000 bytes"), std::string::npos) << error.what();
  }
  EXPECT_EQ(loads, 0);
  const TileCache<VolumeContent> cache(tree, 2 * kBytes, source);
  EXPECT_TRUE(cache.holds(tree.surround));
  EXPECT_TRUE(cache.holds(0));
}

TEST(TileCache, RefusesAContentThatIsLargerThanItsSourceSaid) {
  const TileTree tree = madeTree(2, 2);
  TileSource<VolumeContent> source = sourceOf([](int tile) { return contentOfBytes(kBytes + (tile == 2 ? 1 : 0)); });
  source.file = [](int tile) { return std::to_string(tile) + ".glb"; };
  TileCache<VolumeContent> cache(tree, 100 * kBytes, source);
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

}  // namespace
}  // namespace tessera
