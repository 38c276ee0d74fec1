#include "partition/partition.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

Capture town() {
  Capture capture = flight(10, 8, 20, 60);
  addPoints(capture, 5000, {-20, -20, -0.1}, {200, 160, 0.1}, 1);
  addPoints(capture, 2000, {50, 50, 0}, {70, 70, 15}, 2);
  return capture;
}

TEST(Partition, CoversATownWithItsBlocks) {
  const Partition partition = partitionCapture(town(), {.blocks = {false, 2, 2}});
  EXPECT_EQ(partition.grid.cells(), 4);
  EXPECT_EQ(partition.notes.size(), 3u);
  EXPECT_TRUE(partition.thin.empty());
  ASSERT_EQ(partition.coverage.size(), 4u);
  for (const CellCoverage& cell : partition.coverage) EXPECT_GT(cell.photos, 20);
  // Three photos show x in [-20, 200] and y in [-45, 185] (columns count many times).
  const Vec3d middle = partition.grid.inWorld(Vec3d::Zero());
  EXPECT_NEAR(middle.x(), 90, 3);
  EXPECT_NEAR(middle.y(), 70, 3);
  for (const SparsePoint& point : town().points) {
    const Vec3d at = partition.grid.inGrid(point.xInWorld);
    EXPECT_GE(at.z(), partition.grid.bottom);
    EXPECT_LE(at.z(), partition.grid.top);
  }
}

TEST(Partition, TakesTheCellsThatAreGiven) {
  BlockGrid grid = partitionCapture(town(), {.blocks = {false, 2, 2}}).grid;
  const std::vector<CellCoverage> whole = partitionCapture(town(), {.grid = grid}).coverage;
  const Vec2d corner = grid.centre(3);
  grid.originInWorld = grid.inWorld({corner.x(), corner.y(), 0});
  grid.columns = grid.rows = 1;
  const Partition partition = partitionCapture(town(), {.blocks = {false, 5, 5}, .grid = grid});
  EXPECT_EQ(partition.grid.originInWorld, grid.originInWorld);
  EXPECT_EQ(partition.grid.edge, grid.edge);
  ASSERT_EQ(partition.coverage.size(), 1u);
  EXPECT_EQ(partition.coverage[0].pixels, whole[3].pixels);
  EXPECT_GT(partition.coverage[0].pixelsBeyond, whole[3].pixelsBeyond) << "those of its neighbours";
  EXPECT_NE(partition.notes[2].find("as given"), std::string::npos) << partition.notes[2];
}

TEST(Partition, IsTheSameTwice) {
  const Partition a = partitionCapture(town(), {}), b = partitionCapture(town(), {});
  EXPECT_EQ(a.grid.originInWorld, b.grid.originInWorld);
  EXPECT_EQ(a.grid.gridFromWorld, b.grid.gridFromWorld);
  EXPECT_EQ(a.grid.edge, b.grid.edge);
  EXPECT_EQ(a.grid.top, b.grid.top);
  EXPECT_EQ(a.notes, b.notes);
}

TEST(Partition, TurnsWithATurnedWorld) {
  Capture capture = town();
  const Mat3d rotation = turnAbout({0.2, 0.1, 1}, 20);
  turn(capture, rotation);
  const Partition level = partitionCapture(town(), {.blocks = {false, 2, 2}});
  const Partition turned = partitionCapture(capture, {.blocks = {false, 2, 2}});
  EXPECT_LT((turned.grid.originInWorld - rotation * level.grid.originInWorld).norm(), 4);
  EXPECT_NEAR(turned.grid.edge, level.grid.edge, 0.05 * level.grid.edge);
  EXPECT_LT(degreesBetween(turned.ground.up(), rotation.col(2)), 0.5);
}

TEST(Partition, NamesBlocksThatTooFewPhotosShow) {
  Capture capture = town();
  // Three photos of a far corner stretch the region; the cells between have none.
  for (int i = 0; i < 3; ++i) addPhoto(capture, lookingDown(700, 70, 60));
  const Partition partition = partitionCapture(capture, {.blocks = {false, 8, 3}});
  EXPECT_GE(partition.thin.size(), 3u);
  for (const ThinCell& thin : partition.thin) {
    const CellCoverage& has = partition.coverage[static_cast<size_t>(thin.cell)];
    EXPECT_TRUE(has.photos < 3 || has.pixels < CoverageThresholds{}.pixels) << thin.warning;
  }
}

TEST(Partition, IsFiniteForCamerasInsideTheSceneOrOfTheSkyOrOnlyOne) {
  Capture sky = emptyCapture(), one = emptyCapture();
  for (int i = 0; i < 4; ++i) addPhoto(sky, lookingAt({3.0 * i, 0, 1}, {3.0 * i, 1, 9}, Vec3d::UnitY()));
  addPhoto(one, lookingDown(0, 0, 30));
  for (const Capture& capture : {orbit({0, 0, 1}, 4, 12), sky, one}) {
    const Partition partition = partitionCapture(capture, {});
    const BlockGrid& grid = partition.grid;
    EXPECT_TRUE(grid.originInWorld.allFinite() && std::isfinite(grid.edge) && grid.edge > 0);
    EXPECT_LT(grid.bottom, grid.top);
    EXPECT_LE(grid.top - grid.bottom, grid.edge);
    EXPECT_GE(grid.cells(), 1);
  }
  EXPECT_EQ(partitionCapture(one, {}).thin.size(), 1u);  // one photo is too few, and says so
}

TEST(Partition, RejectsCapturesWithoutTrainingPhotos) {
  Capture capture = flight(2, 2, 10, 10);
  for (Photo& photo : capture.photos) photo.split = Split::test;
  EXPECT_THROW(partitionCapture(capture, {}), Error);
}

}  // namespace
}  // namespace tessera
