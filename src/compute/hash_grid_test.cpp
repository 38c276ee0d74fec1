#include "compute/hash_grid.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

HashGridLevel hashedLevel(int log2Entries) {
  HashGridLevel level;
  level.resolution = 4096;
  level.entries = 1u << log2Entries;
  level.hashed = true;
  return level;
}

std::vector<uint32_t> resolutions(const HashGrid& grid) {
  std::vector<uint32_t> all;
  for (const HashGridLevel& level : grid.levels) all.push_back(level.resolution);
  return all;
}

int denseLevels(const HashGrid& grid) {
  int dense = 0;
  for (const HashGridLevel& level : grid.levels) dense += !level.hashed;
  return dense;
}

TEST(HashGrid, HashesCornersAsTinyCudaNnDoes) {
  struct Row {
    uint32_t x, y, z, in19, in21, in22;
  };
  const Row rows[] = {{0, 0, 0, 0, 0, 0},
                      {1, 0, 0, 1, 1, 1},
                      {0, 1, 0, 489905, 1538481, 3635633},
                      {0, 0, 1, 153493, 153493, 153493},
                      {1, 2, 3, 128476, 652764, 2749916},
                      {255, 255, 255, 461531, 1510107, 1510107},
                      {1023, 17, 512, 15678, 15678, 15678},
                      {2047, 2047, 2047, 285147, 809435, 2906587}};
  for (const Row& row : rows) {
    EXPECT_EQ(hashGridIndex(hashedLevel(19), row.x, row.y, row.z), row.in19);
    EXPECT_EQ(hashGridIndex(hashedLevel(21), row.x, row.y, row.z), row.in21);
    EXPECT_EQ(hashGridIndex(hashedLevel(22), row.x, row.y, row.z), row.in22);
  }
}

TEST(HashGrid, PlacesDenseCornersRowByRowAndWrapsTheOneBeyondTheEnd) {
  const HashGrid grid({1, 2, 19, 16, 16});
  const HashGridLevel& level = grid.levels[0];
  ASSERT_FALSE(level.hashed);
  EXPECT_EQ(level.entries, 4096u);
  EXPECT_EQ(hashGridIndex(level, 3, 0, 0), 3u);
  EXPECT_EQ(hashGridIndex(level, 3, 2, 1), 3u + 16 * 2 + 256);
  EXPECT_EQ(hashGridIndex(level, 16, 15, 15), 0u);
}

TEST(HashGrid, GrowsFrom16To2048In16Levels) {
  const HashGrid grid({16, 2, 19, 16, 2048});
  EXPECT_EQ(resolutions(grid),
            (std::vector<uint32_t>{16, 23, 31, 43, 59, 81, 112, 154, 213, 295, 407, 562, 777, 1073, 1483, 2048}));
  EXPECT_EQ(denseLevels(grid), 5);
  EXPECT_EQ(grid.entries(), 6098120u);
  EXPECT_EQ(grid.parameters(), 12196240u);
  for (int l = 1; l < 16; ++l)
    EXPECT_NEAR((grid.levels[l].scale + 1) / (grid.levels[l - 1].scale + 1), 1.3819129, 1e-6);
}

TEST(HashGrid, DoublesWithoutRoundingErrors) {
  const HashGrid grid({8, 4, 19, 16, 2048});
  EXPECT_EQ(resolutions(grid), (std::vector<uint32_t>{16, 32, 64, 128, 256, 512, 1024, 2048}));
  EXPECT_EQ(denseLevels(grid), 3);
  EXPECT_EQ(grid.entries(), 2920448u);
}

TEST(HashGrid, CallsALevelDenseThatFitsExactly) {
  const HashGrid grid({6, 4, 21, 16, 512});
  EXPECT_EQ(resolutions(grid), (std::vector<uint32_t>{16, 32, 64, 128, 256, 512}));
  EXPECT_EQ(denseLevels(grid), 4);
  EXPECT_EQ(grid.entries(), 6590464u);
}

TEST(HashGrid, PutsLevelsOneBehindTheOther) {
  const HashGrid grid({5, 2, 12, 4, 100});
  size_t next = 0;
  for (const HashGridLevel& level : grid.levels) {
    EXPECT_EQ(level.firstEntry, next);
    EXPECT_EQ(level.entries % 8, 0u);
    next += level.entries;
  }
  EXPECT_EQ(grid.entries(), next);
  EXPECT_EQ(grid.columns(), 10u);
}

}  // namespace
}  // namespace tessera
