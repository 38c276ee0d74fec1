#include "representations/volume/bake/occupied_texels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace tessera {
namespace {

VirtualGrid smallGrid() {
  VirtualGrid grid;
  grid.voxels = 32;
  grid.planes = 96;  // no multiple of a power of two times the voxels
  return grid;
}

struct Point {
  float at[3];
};

std::vector<Point> points(size_t count) {
  const RandomStream random(3, 0xa11);
  std::vector<Point> positions(count);
  for (size_t i = 0; i < count; ++i) {
    for (size_t a = 0; a < 3; ++a) {
      positions[i].at[a] = random.uniform(4 * i + a);
      if (random.below(4 * i + 3, 6) == a) positions[i].at[a] = i % 2 ? 0.0f : 1.0f;  // on a face of the domain
    }
  }
  return positions;
}

uint32_t clampedFloor(double u, uint32_t count) {
  return static_cast<uint32_t>(std::clamp(std::floor(u), 0.0, count - 1.0));
}

// A renderer finds the macroblock by its clamped lookup coordinate.
TEST(OccupiedTexels, KeepTheMacroblockThatARendererLooksInto) {
  const VirtualGrid grid = smallGrid();
  for (const Point& point : points(400)) {
    OccupiedTexels occupied(grid);
    occupied.mark(point.at);
    const std::vector<bool> macroblocks = occupied.macroblocks();
    uint32_t b[3];
    for (int a = 0; a < 3; ++a) {
      b[a] = clampedFloor(static_cast<double>(point.at[a]) * grid.voxels - 0.5, grid.voxels) / 8;
    }
    EXPECT_TRUE(macroblocks[b[0] + 4 * (b[1] + 4 * b[2])]);
    EXPECT_LE(std::count(macroblocks.begin(), macroblocks.end(), true), 8);
  }
}

TEST(OccupiedTexels, KeepTheOccupancyCellOfEverySample) {
  const VirtualGrid grid = smallGrid();
  for (const Point& point : points(400)) {
    OccupiedTexels occupied(grid);
    occupied.mark(point.at);
    const OccupancyBits cells = occupied.occupancy(grid.planes / 8);
    uint32_t c[3];
    for (int a = 0; a < 3; ++a) c[a] = clampedFloor(static_cast<double>(point.at[a]) * cells.cells, cells.cells);
    EXPECT_TRUE(cells.at(c[0], c[1], c[2]));
  }
}

TEST(OccupiedTexels, KeepMacroblocksAndCellsWhereSeveralTexelsShareABit) {
  VirtualGrid grid;
  grid.voxels = 128;
  grid.planes = 2 * OccupiedTexels::kMaxCells;
  const uint32_t edge = grid.voxels / 8;
  const std::vector<Point> seen = points(40);
  OccupiedTexels occupied(grid);
  for (const Point& point : seen) occupied.mark(point.at);
  const std::vector<bool> macroblocks = occupied.macroblocks();
  const OccupancyBits cells = occupied.occupancy(grid.planes / 8);
  for (const Point& point : seen) {
    uint32_t b[3], c[3];
    for (int a = 0; a < 3; ++a) {
      b[a] = clampedFloor(static_cast<double>(point.at[a]) * grid.voxels - 0.5, grid.voxels) / 8;
      c[a] = clampedFloor(static_cast<double>(point.at[a]) * cells.cells, cells.cells);
    }
    EXPECT_TRUE(macroblocks[b[0] + edge * (b[1] + edge * b[2])]);
    EXPECT_TRUE(cells.at(c[0], c[1], c[2]));
  }
}

TEST(OccupiedTexels, KeepThePlanesTexelsAroundASampleAndAsFarAsTheyReach) {
  const VirtualGrid grid = smallGrid();
  OccupiedTexels occupied(grid);
  const float position[3] = {0.5f, 0.25f, 0.75f};
  occupied.mark(position);
  const auto count = [](const std::vector<bool>& bits) { return std::count(bits.begin(), bits.end(), true); };
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(count(occupied.plane(axis, 0)), 4);
    EXPECT_EQ(count(occupied.plane(axis, 3)), 8 * 8);
  }
  // Plane 2 has x along its rows: the lookup coordinates are 47.5 and 23.5.
  const std::vector<bool> plane = occupied.plane(2, 0);
  for (const size_t row : {23u, 24u}) {
    for (const size_t column : {47u, 48u}) EXPECT_TRUE(plane[row * grid.planes + column]);
  }
}

TEST(OccupiedTexels, DoNotReachBeyondThePlanes) {
  const VirtualGrid grid = smallGrid();
  OccupiedTexels occupied(grid);
  const float corner[3] = {0, 0, 1};
  occupied.mark(corner);
  const std::vector<bool> plane = occupied.plane(2, 2);
  EXPECT_EQ(std::count(plane.begin(), plane.end(), true), 9);
  EXPECT_FALSE(plane[size_t{1} * grid.planes - 1]) << "the marks do not wrap to the other side";
}

TEST(OccupiedTexels, TakeMemoryOnlyWhereCellsAreMarked) {
  VirtualGrid grid;
  grid.voxels = 128;
  grid.planes = 512;
  OccupiedTexels occupied(grid);
  const size_t planes = 3 * 512 * 512 / 8, empty = occupied.bytes();
  EXPECT_LE(empty, planes + (256u << 10));
  const float point[3] = {0.26f, 0.26f, 0.26f};
  for (int i = 0; i < 3; ++i) occupied.mark(point);
  EXPECT_EQ(occupied.bytes(), empty + 512);
  for (uint32_t y = 0; y < 256; ++y) {
    for (uint32_t x = 0; x < 256; ++x) {
      const float ground[3] = {static_cast<float>(x) / 256, static_cast<float>(y) / 256, 0.51f};
      occupied.mark(ground);
    }
  }
  EXPECT_LE(occupied.bytes(), empty + (1u << 20)) << "a level ground";
}

TEST(OccupiedTexels, AreEmptyWhereNothingIsMarked) {
  const OccupiedTexels occupied(smallGrid());
  const std::vector<bool> macroblocks = occupied.macroblocks();
  EXPECT_EQ(std::count(macroblocks.begin(), macroblocks.end(), true), 0);
  for (const uint64_t word : occupied.occupancy(12).words) EXPECT_EQ(word, 0u);
}

}  // namespace
}  // namespace tessera
