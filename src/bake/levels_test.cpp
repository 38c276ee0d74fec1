#include "bake/levels.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tessera {
namespace {

TEST(Levels, MergeTwoByTwoUntilFewAreLeftThenAll) {
  EXPECT_EQ(topLevel(1, 1, 1024), 0u);
  EXPECT_EQ(topLevel(2, 1, 1024), 1u);
  EXPECT_EQ(topLevel(2, 2, 1024), 1u);
  EXPECT_EQ(topLevel(4, 4, 1024), 2u);
  // The paper's campus: 24 models, then 6, then 1.
  EXPECT_EQ(topLevel(6, 4, 1024), 2u);
  EXPECT_EQ(groupsOfLevel(6, 4, 0, false).groups(), 24u);
  EXPECT_EQ(groupsOfLevel(6, 4, 1, false).groups(), 6u);
  EXPECT_EQ(groupsOfLevel(6, 4, 2, false).groups(), 1u);
  EXPECT_EQ(groupsOfLevel(9, 9, 1, false).groups(), 25u);
  EXPECT_EQ(groupsOfLevel(9, 9, 2, false).groups(), 9u);
  EXPECT_EQ(groupsOfLevel(9, 9, 3, false).groups(), 4u);
}

TEST(Levels, EndWhereATileCannotHoldMoreBlocks) {
  EXPECT_EQ(topLevel(32, 32, 1024), 5u);
  EXPECT_EQ(groupsOfLevel(32, 32, 5, false).groups(), 1u);
  EXPECT_EQ(topLevel(33, 33, 1024), 5u);
  EXPECT_EQ(groupsOfLevel(33, 33, 5, false).groups(), 4u);
  EXPECT_EQ(topLevel(32, 32, 1023), 4u);
  EXPECT_EQ(topLevel(11, 11, 128), 4u);
  EXPECT_EQ(groupsOfLevel(11, 11, 4, false).groups(), 1u);
  EXPECT_EQ(topLevel(12, 12, 128), 3u);
  EXPECT_EQ(groupsOfLevel(12, 12, 3, false).groups(), 4u);
}

TEST(Levels, HoldEveryBlockOnceInRectanglesThatNest) {
  for (const auto& [columns, rows] : {std::pair{1u, 1u}, {2u, 3u}, {5u, 4u}, {7u, 1u}, {9u, 9u}}) {
    for (uint32_t level = 0; level <= topLevel(columns, rows, 1024); ++level) {
      const LevelGroups groups = groupsOfLevel(columns, rows, level, true);
      ASSERT_EQ(groups.groupOfBlock.size(), columns * rows + 1);
      EXPECT_EQ(groups.groupOfBlock.back(), groups.cells.size()) << "the background block is a group of its own";
      for (uint32_t block = 0; block < columns * rows; ++block) {
        const CellRange& cells = groups.cells.at(groups.groupOfBlock[block]);
        const uint32_t i = block % columns, j = block / columns;
        EXPECT_TRUE(cells.first[0] <= i && i < cells.end[0] && cells.first[1] <= j && j < cells.end[1]);
      }
      if (level == 0) continue;
      const LevelGroups below = groupsOfLevel(columns, rows, level - 1, true);
      for (uint32_t a = 0; a < columns * rows; ++a) {
        for (uint32_t b = 0; b < columns * rows; ++b) {
          if (below.groupOfBlock[a] == below.groupOfBlock[b]) {
            EXPECT_EQ(groups.groupOfBlock[a], groups.groupOfBlock[b]);
          }
        }
      }
    }
    EXPECT_EQ(groupsOfLevel(columns, rows, topLevel(columns, rows, 1024), false).groups(), 1u);
  }
}

}  // namespace
}  // namespace tessera
