#include "partition/block_layout.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "partition/testing/test_captures.h"
#include "scene/block_grid_json.h"

namespace tessera {
namespace {

Region makeRegion(double width, double depth, double groundPixel) {
  Region region;
  region.rectangle = {{10, 20}, 0.3, width, depth};
  region.groundPixel = groundPixel;
  return region;
}

constexpr BlockCount kAutomatic;
const BlockLimits kGenerousLimits = {.texelsPerEdge = 500, .bytesPerBlock = 1, .memoryBudget = 1e9};

TEST(BlockCount, IsReadFromAutoAndFromTwoNumbers) {
  EXPECT_TRUE(parseBlockCount("auto")->automatic);
  const auto count = parseBlockCount("3x12");
  ASSERT_TRUE(count.has_value());
  EXPECT_FALSE(count->automatic);
  EXPECT_EQ(count->columns, 3);
  EXPECT_EQ(count->rows, 12);
  for (const char* text : {"", "x", "3", "3x", "x3", "0x1", "-1x2", "3x2x1", "3 x 2", "3.5x2", "3x2 ", "AUTO", "+3x2",
                           "99999999999x1", "65536x2", "65537x1"}) {
    EXPECT_FALSE(parseBlockCount(text).has_value()) << text;
  }
}

TEST(BlockLayout, CentresTheRegionInTheRequestedCells) {
  const BlockLayout layout = layOutBlocks({}, makeRegion(100, 40, 0.1), {-1, 7}, {false, 4, 2}, kGenerousLimits);
  EXPECT_EQ(layout.decidedBy, DecidedBy::request);
  EXPECT_EQ(layout.grid.columns, 4);
  EXPECT_EQ(layout.grid.rows, 2);
  EXPECT_DOUBLE_EQ(layout.grid.edge, 25);  // the larger of 100 / 4 and 40 / 2
  EXPECT_LT((layout.grid.inWorld({0, 0, 0}) - Vec3d(10, 20, 3)).norm(), 1e-12);
  EXPECT_EQ(layout.grid.bottom, -4);
  EXPECT_EQ(layout.grid.top, 4);
}

TEST(BlockLayout, TurnsTheGridWithRegionAndGround) {
  Ground ground;
  ground.groundFromWorld = turnAbout({1, 0.5, 0}, 15);
  ground.height = 6;
  const Region region = makeRegion(100, 40, 0.1);
  const BlockGrid grid = layOutBlocks(ground, region, {-1, 7}, {false, 4, 2}, kGenerousLimits).grid;
  EXPECT_LT((grid.gridFromWorld * grid.gridFromWorld.transpose() - Mat3d::Identity()).norm(), 1e-12);
  const Vec2d corner = region.rectangle.outside({50, 20});
  const Vec3d onGround = grid.inGrid(ground.inWorld({corner.x(), corner.y(), 0}));
  EXPECT_LT((onGround - Vec3d(50, 20, -3)).norm(), 1e-9);  // midway between the heights is 3 above the ground
}

TEST(BlockLayout, MakesTexelsAsFineAsThePhotos) {
  // Cells may be 1.5 · 0.1 · 500 = 75 wide: 1000 × 400 takes 14 × 6 of them, with an edge of 1000 / 14.
  const BlockLayout layout = layOutBlocks({}, makeRegion(1000, 400, 0.1), {-1, 9}, kAutomatic, kGenerousLimits);
  EXPECT_EQ(layout.decidedBy, DecidedBy::detail);
  EXPECT_EQ(layout.grid.columns, 14);
  EXPECT_EQ(layout.grid.rows, 6);
  EXPECT_DOUBLE_EQ(layout.grid.edge, 1000.0 / 14);
  EXPECT_LE(layout.grid.edge / 500, 1.5 * 0.1);
}

TEST(BlockLayout, UsesOneBlockForASmallRegion) {
  const BlockLayout layout = layOutBlocks({}, makeRegion(30, 20, 0.1), {-1, 9}, kAutomatic, kGenerousLimits);
  EXPECT_EQ(layout.decidedBy, DecidedBy::detail);
  EXPECT_EQ(layout.grid.cells(), 1);
  EXPECT_DOUBLE_EQ(layout.grid.edge, 30);
}

TEST(BlockLayout, StaysWithinTheMemoryBudgetAndUsesItWell) {
  for (int maximum = 1; maximum <= 83; ++maximum) {
    BlockLimits limits = kGenerousLimits;
    limits.bytesPerBlock = 10;
    limits.memoryBudget = 10 * maximum + 9;
    const BlockLayout layout = layOutBlocks({}, makeRegion(1000, 400, 0.1), {-1, 9}, kAutomatic, limits);
    EXPECT_EQ(layout.decidedBy, DecidedBy::memory) << maximum;
    EXPECT_LE(layout.grid.cells(), maximum);
    // No other count within the budget has smaller cells.
    for (int columns = 1; columns <= maximum; ++columns) {
      for (int rows = 1; rows * columns <= maximum; ++rows) {
        EXPECT_GE(std::max(1000.0 / columns, 400.0 / rows), layout.grid.edge * (1 - 1e-12)) << maximum;
      }
    }
  }
}

TEST(BlockLayout, CoversTheWholeRegion) {
  for (const double width : {1.0, 99.9, 1000.0 / 3}) {
    for (const double pixel : {0.3, 0.01}) {
      const Region region = makeRegion(width, 77, pixel);
      for (const BlockCount& count : {kAutomatic, BlockCount{false, 3, 5}}) {
        const BlockGrid grid = layOutBlocks({}, region, {0, 0.5}, count, kGenerousLimits).grid;
        EXPECT_GE(grid.edge * grid.columns, width * (1 - 1e-9));
        EXPECT_GE(grid.edge * grid.rows, 77 * (1 - 1e-9));
      }
    }
  }
}

TEST(BlockLayout, UsesOneBlockWhereTheBudgetAllowsNone) {
  BlockLimits limits = kGenerousLimits;
  limits.bytesPerBlock = 2e9;
  const BlockLayout layout = layOutBlocks({}, makeRegion(1000, 400, 0.1), {-1, 9}, kAutomatic, limits);
  EXPECT_EQ(layout.grid.cells(), 1);
  EXPECT_NE(layout.how.find("more than the budget"), std::string::npos) << layout.how;
}

TEST(BlockLayout, IsNeverHigherThanItsCellsAreWide) {
  const BlockLayout asked = layOutBlocks({}, makeRegion(100, 100, 0.1), {-10, 30}, {false, 5, 5}, kGenerousLimits);
  EXPECT_EQ(asked.grid.columns, 5);
  EXPECT_DOUBLE_EQ(asked.grid.edge, 40);
  EXPECT_NE(asked.how.find("enlarged from 20 to 40"), std::string::npos) << asked.how;
  const BlockLayout chosen = layOutBlocks({}, makeRegion(100, 100, 0.01), {-10, 30}, kAutomatic, kGenerousLimits);
  EXPECT_EQ(chosen.decidedBy, DecidedBy::height);
  EXPECT_EQ(chosen.grid.columns, 3);
  EXPECT_LE(chosen.grid.top - chosen.grid.bottom, chosen.grid.edge);
  for (const BlockLayout& layout : {asked, chosen}) {
    EXPECT_TRUE(blockGridFromJson(blockGridToJson(layout.grid)).has_value());
  }
}

}  // namespace
}  // namespace tessera
