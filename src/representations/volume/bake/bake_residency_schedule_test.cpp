#include "representations/volume/bake/bake_residency_schedule.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tessera {
namespace {

// Returns photos with the given number of tiles for each set of blocks.
TiledPhotos tiles(const std::vector<std::pair<std::vector<uint32_t>, int>>& tilesOfSets) {
  TiledPhotos photos;
  for (const auto& [set, count] : tilesOfSets) {
    for (int i = 0; i < count; ++i) {
      photos.tiles.push_back({});
      photos.setOfTile.push_back(static_cast<uint32_t>(photos.sets.size()));
    }
    photos.sets.push_back(set);
  }
  return photos;
}

bool holds(const std::vector<uint32_t>& residentSet, const std::vector<uint32_t>& set) {
  return std::all_of(set.begin(), set.end(), [&](uint32_t block) {
    return std::find(residentSet.begin(), residentSet.end(), block) != residentSet.end();
  });
}

TEST(BakeResidencySchedule, VisitsATileOnceWhereOneResidentSetHasAllItsBlocks) {
  const TiledPhotos photos =
      tiles({{{}, 10}, {{0}, 30}, {{1}, 30}, {{2}, 30}, {{0, 1}, 20}, {{1, 2}, 20}, {{0, 2}, 9}});
  const BakeResidencySchedule residentSets(photos, 3, 2);
  EXPECT_EQ(residentSets.inParts(), 0);
  for (uint32_t set = 0; set < photos.sets.size(); ++set) {
    ASSERT_EQ(residentSets.residentSetsForSet(set).size(), 1u);
    const uint32_t residentSet = residentSets.residentSetsForSet(set)[0];
    EXPECT_TRUE(holds(residentSets.residentSets()[residentSet], photos.sets[set]));
    for (uint32_t earlier = 0; earlier < residentSet; ++earlier) {
      EXPECT_FALSE(holds(residentSets.residentSets()[earlier], photos.sets[set])) << "the first";
    }
    EXPECT_EQ(residentSets.bestFor(photos.sets[set]), residentSet);
  }
}

TEST(BakeResidencySchedule, VisitsATileInPartsWhereItsBlocksDoNotFitTogether) {
  const TiledPhotos photos = tiles({{{0, 1}, 40}, {{2, 3}, 40}, {{0, 1, 2, 3}, 20}});
  const BakeResidencySchedule residentSets(photos, 4, 2);
  EXPECT_DOUBLE_EQ(residentSets.inParts(), 0.2);
  ASSERT_EQ(residentSets.residentSetsForSet(2).size(), 2u);
  std::vector<uint32_t> seen;
  for (const uint32_t residentSet : residentSets.residentSetsForSet(2)) {
    seen.insert(seen.end(), residentSets.residentSets()[residentSet].begin(),
                residentSets.residentSets()[residentSet].end());
  }
  EXPECT_TRUE(holds(seen, {0, 1, 2, 3}));
  EXPECT_EQ(residentSets.residentSets().size(), 2u);
}

TEST(BakeResidencySchedule, HoldsEveryBlockThatIsSeenHoweverRarely) {
  const TiledPhotos photos = tiles({{{0}, 1000}, {{3, 4, 5}, 1}, {{2}, 1}});
  const BakeResidencySchedule residentSets(photos, 6, 2);
  for (const std::vector<uint32_t>& residentSet : residentSets.residentSets()) EXPECT_LE(residentSet.size(), 2u);
  for (uint32_t set = 0; set < photos.sets.size(); ++set) {
    std::vector<uint32_t> seen;
    for (const uint32_t residentSet : residentSets.residentSetsForSet(set)) {
      seen.insert(seen.end(), residentSets.residentSets()[residentSet].begin(),
                  residentSets.residentSets()[residentSet].end());
    }
    EXPECT_TRUE(holds(seen, photos.sets[set])) << set;
  }
  EXPECT_NEAR(residentSets.inParts(), 1.0 / 1002, 1e-12);
}

TEST(BakeResidencySchedule, HasOneResidentSetWhereNothingIsSeen) {
  const BakeResidencySchedule residentSets({}, 5, 2);
  EXPECT_EQ(residentSets.residentSets().size(), 1u);
  EXPECT_EQ(residentSets.inParts(), 0);
}

}  // namespace
}  // namespace tessera
