#include "partition/coverage.h"

#include <gtest/gtest.h>

#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

// Returns a grid of cells of edge 100 over the ground z = 0, with its origin in the middle and `up` above it.
BlockGrid makeGrid(int columns, int rows, double up = 0) {
  BlockGrid grid;
  grid.edge = 100;
  grid.columns = columns;
  grid.rows = rows;
  grid.originInWorld.z() = up;
  return grid;
}

TEST(Coverage, AssignsPixelsToTheCellsWhereTheirRaysEnd) {
  Capture capture = emptyCapture();
  addPhoto(capture, lookingDown(0, 0, 50));  // shows 100 × 75 around the corner of four cells
  const auto coverage = countCoverage(capture, makeGrid(2, 2, 20), Ground{}, true);
  ASSERT_EQ(coverage.size(), 4u);
  for (const CellCoverage& cell : coverage) {
    EXPECT_EQ(cell.photos, 1);
    EXPECT_EQ(cell.pixels, 400 * 300 / 4);
    EXPECT_EQ(cell.pixelsBeyond, 0);
  }
}

TEST(Coverage, NumbersCellsAlongXFirst) {
  Capture capture = emptyCapture();
  addPhoto(capture, lookingDown(100, -50, 10));  // the last of three columns, the first of two rows
  addPhoto(capture, lookingDown(100, -50, 10));
  addPhoto(capture, lookingDown(-100, 50, 10));
  capture.photos[1].split = Split::test;
  const auto coverage = countCoverage(capture, makeGrid(3, 2), Ground{}, true);
  for (size_t cell = 0; cell < 6; ++cell) {
    EXPECT_EQ(coverage[cell].photos, cell == 2 || cell == 3 ? 1 : 0) << cell;
    EXPECT_EQ(coverage[cell].pixels, cell == 2 || cell == 3 ? 400 * 300 : 0) << cell;
  }
}

TEST(Coverage, CountsPixelsBeyondTheCells) {
  Capture capture = emptyCapture();
  addPhoto(capture, lookingDown(200, 0, 10));   // beside the second cell
  addPhoto(capture, lookingDown(100, 0, 100));  // 0…200: half inside, half beyond
  const auto coverage = countCoverage(capture, makeGrid(2, 1), Ground{}, true);
  EXPECT_EQ(coverage[1].photos, 1);
  EXPECT_EQ(coverage[0].photos, 0);
  EXPECT_NEAR(static_cast<double>(coverage[1].pixels), 400 * 300 * 0.5 * (100.0 / 150), 4000);
  EXPECT_EQ(coverage[1].pixels + coverage[1].pixelsBeyond, 2 * 400 * 300);
}

TEST(Coverage, UsesTheGivenRayDepths) {
  Capture capture = emptyCapture();
  addPhoto(capture, lookingAt({-60, 0, 5}, {60, 0, 5}, Vec3d::UnitZ()));  // level: most rays never meet the ground
  const BlockGrid grid = makeGrid(2, 1);
  const auto blind = countCoverage(capture, grid, Ground{}, true);
  EXPECT_LT(blind[0].pixels + blind[1].pixels + blind[0].pixelsBeyond + blind[1].pixelsBeyond, 400 * 300 * 0.51);
  std::vector<Vec2d> asked;
  const auto seeing = countCoverage(capture, grid, Ground{}, true, [&](int photo, const Vec2d& pixel) {
    EXPECT_EQ(photo, 0);
    asked.push_back(pixel);
    return pixel.x() < 200 ? 20.0 : 0.0;  // the left half ends after 20 units
  });
  EXPECT_EQ(asked.size(), static_cast<size_t>(kCoverageColumns * kCoverageRows));
  EXPECT_EQ(asked.front(), Vec2d(0.5 * 400 / kCoverageColumns, 0.5 * 300 / kCoverageRows));
  EXPECT_GE(seeing[0].pixels, 400 * 300 / 2);  // and the rays of the right half that meet the ground before x = 0
  EXPECT_LT(seeing[0].pixels, 400 * 300 * 0.75);
}

TEST(Coverage, IsEmptyForCamerasUnderTheGround) {
  Capture capture = emptyCapture();
  addPhoto(capture, lookingDown(0, 0, -20));
  addPhoto(capture, lookingAt({0, 0, -20}, {0, 0, 10}, Vec3d::UnitY()));
  for (const CellCoverage& cell : countCoverage(capture, makeGrid(2, 2), Ground{}, true)) {
    EXPECT_EQ(cell.photos, 0);
    EXPECT_EQ(cell.pixels + cell.pixelsBeyond, 0);
  }
}

TEST(Coverage, EndsRaysAtTheGridCentreForCamerasInsideTheScene) {
  const Capture capture = orbit({0, 0, 2}, 40, 12);
  const auto coverage = countCoverage(capture, makeGrid(1, 1, 2), Ground{}, false);
  EXPECT_EQ(coverage[0].photos, 12);
  EXPECT_EQ(coverage[0].pixels, 12 * 400 * 300);
}

TEST(Coverage, FollowsATiltedGround) {
  const Mat3d rotation = turnAbout({1, 1, 0}, 25);
  Capture capture = emptyCapture();
  addPhoto(capture, lookingDown(-50, 0, 57));
  turn(capture, rotation);
  Ground ground;
  ground.groundFromWorld = rotation.transpose();
  ground.height = 7;
  BlockGrid grid = makeGrid(2, 1);
  grid.gridFromWorld = rotation.transpose();
  grid.originInWorld = ground.inWorld({0, 0, 30});
  const auto coverage = countCoverage(capture, grid, ground, true);
  EXPECT_EQ(coverage[0].pixels, 400 * 300);  // 100 × 75 exactly in the first cell
  EXPECT_EQ(coverage[1].pixels, 0);
}

TEST(ThinCells, AreNamedWithWhatTheyLack) {
  const BlockGrid grid = makeGrid(3, 2);
  std::vector<CellCoverage> coverage(6, {.photos = 5, .pixels = 20000});
  EXPECT_TRUE(thinCells(grid, coverage, {3, 20000}).empty());
  coverage[2] = {.photos = 2, .pixels = 20000};
  coverage[4] = {.photos = 5, .pixels = 19999, .pixelsBeyond = 50000};
  const auto thin = thinCells(grid, coverage, {3, 20000});
  ASSERT_EQ(thin.size(), 2u);
  EXPECT_EQ(thin[0].cell, 2);
  EXPECT_EQ(thin[0].warning,
            "block (2, 0) around x 100.0, y -50.0 is seen by 2 training photos in 20000 pixels; 3 photos and 20000 "
            "pixels are the least: add photos of that place, or make blocks larger");
  EXPECT_EQ(thin[1].cell, 4);
  EXPECT_NE(thin[1].warning.find("block (1, 1) around x 0.0, y 50.0"), std::string::npos) << thin[1].warning;
}

}  // namespace
}  // namespace tessera
