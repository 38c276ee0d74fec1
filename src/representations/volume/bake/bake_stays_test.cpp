#include "representations/volume/bake/bake_stays.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tessera {
namespace {

// So many tiles of each set.
TiledPhotos tiles(const std::vector<std::pair<std::vector<uint32_t>, int>>& tilesOfSets) {
  TiledPhotos made;
  for (const auto& [set, count] : tilesOfSets) {
    for (int i = 0; i < count; ++i) {
      made.tiles.push_back({});
      made.setOfTile.push_back(static_cast<uint32_t>(made.sets.size()));
    }
    made.sets.push_back(set);
  }
  return made;
}

bool holds(const std::vector<uint32_t>& stay, const std::vector<uint32_t>& set) {
  return std::all_of(set.begin(), set.end(),
                     [&](uint32_t block) { return std::find(stay.begin(), stay.end(), block) != stay.end(); });
}

TEST(BakeStays, LookThroughATileOnceWhereAllItsBlocksAre) {
  const TiledPhotos photos =
      tiles({{{}, 10}, {{0}, 30}, {{1}, 30}, {{2}, 30}, {{0, 1}, 20}, {{1, 2}, 20}, {{0, 2}, 9}});
  const BakeStays stays(photos, 3, 2);
  EXPECT_EQ(stays.inParts(), 0);
  for (uint32_t set = 0; set < photos.sets.size(); ++set) {
    ASSERT_EQ(stays.staysOfSet(set).size(), 1u);
    const uint32_t stay = stays.staysOfSet(set)[0];
    EXPECT_TRUE(holds(stays.stays()[stay], photos.sets[set]));
    for (uint32_t earlier = 0; earlier < stay; ++earlier) {
      EXPECT_FALSE(holds(stays.stays()[earlier], photos.sets[set])) << "the first";
    }
    EXPECT_EQ(stays.bestFor(photos.sets[set]), stay);
  }
}

TEST(BakeStays, LookInPartsWhereBlocksDoNotFitTogether) {
  const TiledPhotos photos = tiles({{{0, 1}, 40}, {{2, 3}, 40}, {{0, 1, 2, 3}, 20}});
  const BakeStays stays(photos, 4, 2);
  EXPECT_DOUBLE_EQ(stays.inParts(), 0.2);
  ASSERT_EQ(stays.staysOfSet(2).size(), 2u);
  std::vector<uint32_t> seen;
  for (const uint32_t stay : stays.staysOfSet(2)) {
    seen.insert(seen.end(), stays.stays()[stay].begin(), stays.stays()[stay].end());
  }
  EXPECT_TRUE(holds(seen, {0, 1, 2, 3}));
  EXPECT_EQ(stays.stays().size(), 2u);
}

TEST(BakeStays, HoldEveryBlockThatIsSeenHoweverRarely) {
  const TiledPhotos photos = tiles({{{0}, 1000}, {{3, 4, 5}, 1}, {{2}, 1}});
  const BakeStays stays(photos, 6, 2);
  for (const std::vector<uint32_t>& stay : stays.stays()) EXPECT_LE(stay.size(), 2u);
  for (uint32_t set = 0; set < photos.sets.size(); ++set) {
    std::vector<uint32_t> seen;
    for (const uint32_t stay : stays.staysOfSet(set)) {
      seen.insert(seen.end(), stays.stays()[stay].begin(), stays.stays()[stay].end());
    }
    EXPECT_TRUE(holds(seen, photos.sets[set])) << set;
  }
  EXPECT_NEAR(stays.inParts(), 1.0 / 1002, 1e-12);
}

TEST(BakeStays, AreOneWhereNothingIsSeen) {
  const BakeStays stays({}, 5, 2);
  EXPECT_EQ(stays.stays().size(), 1u);
  EXPECT_EQ(stays.inParts(), 0);
}

}  // namespace
}  // namespace tessera
