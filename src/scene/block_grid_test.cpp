#include "scene/block_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/random.h"

namespace tessera {
namespace {

class Points {
 public:
  explicit Points(uint64_t seed) : random_(seed, 0) {}
  double uniform(double low, double high) { return low + (high - low) * random_.uniformDouble(next_++); }
  Vec2d inSquare(double half) {
    const double x = uniform(-half, half);
    return {x, uniform(-half, half)};
  }

 private:
  RandomStream random_;
  uint64_t next_ = 0;
};

BlockGrid makeGrid(int columns, int rows, double edge = 2.5) {
  BlockGrid grid;
  grid.columns = columns;
  grid.rows = rows;
  grid.edge = edge;
  return grid;
}

const BlockGrid kGrids[] = {makeGrid(1, 1), makeGrid(3, 2), makeGrid(2, 5, 0.3), makeGrid(1, 4)};

// Returns whether x belongs to cell i of `count` along one axis: its own interval, and for cells at the border
// everything beyond it.
bool owns(int i, int count, double edge, double x) {
  const double low = edge * (i - 0.5 * count), high = low + edge;
  return (i == 0 || x >= low) && (i == count - 1 || x < high);
}

TEST(BlockGrid, AssignsEveryPointToExactlyOneCell) {
  Points points(1);
  for (const BlockGrid& grid : kGrids) {
    std::set<int> met;
    for (int n = 0; n < 1000; ++n) {
      const Vec2d x = points.inSquare(grid.edge * 5);
      int owners = 0, owner = -1;
      for (int cell = 0; cell < grid.cells(); ++cell) {
        if (!owns(cell % grid.columns, grid.columns, grid.edge, x.x())) continue;
        if (!owns(cell / grid.columns, grid.rows, grid.edge, x.y())) continue;
        ++owners;
        owner = cell;
      }
      ASSERT_EQ(owners, 1);
      ASSERT_EQ(grid.cellAt(x), owner) << x.transpose();
      met.insert(owner);
    }
    EXPECT_EQ(met.size(), static_cast<size_t>(grid.cells()));
  }
}

TEST(BlockGrid, CentresItsCellsOnTheOrigin) {
  const BlockGrid grid = makeGrid(3, 2, 4);
  EXPECT_EQ(grid.centre(0), Vec2d(-4, -2));
  EXPECT_EQ(grid.centre(2), Vec2d(4, -2));
  EXPECT_EQ(grid.centre(4), Vec2d(0, 2));
  for (const BlockGrid& each : kGrids)
    for (int cell = 0; cell < each.cells(); ++cell) EXPECT_EQ(each.cellAt(each.centre(cell)), cell);
}

TEST(BlockGrid, OrdersCellsFrontToBackForEveryRayFromAPoint) {
  Points points(2);
  for (const BlockGrid& grid : kGrids) {
    size_t longest = 0;
    for (int n = 0; n < 300; ++n) {
      const Vec2d from = points.inSquare(grid.edge * (n % 2 == 0 ? 0.5 * std::max(grid.columns, grid.rows) : 6));
      const std::vector<int> order = grid.frontToBack(from);
      std::vector<int> all = order;
      std::sort(all.begin(), all.end());
      for (int cell = 0; cell < grid.cells(); ++cell) ASSERT_EQ(all[cell], cell);
      ASSERT_EQ(all.size(), static_cast<size_t>(grid.cells()));

      const double angle = points.uniform(0, 6.2831853);
      const Vec2d direction(std::cos(angle), std::sin(angle));
      std::vector<size_t> places;  // positions in `order` of the cells that the ray crosses
      for (double t = 0; t < 20 * grid.edge; t += 0.01 * grid.edge) {
        const int cell = grid.cellAt(from + t * direction);
        const size_t place = std::find(order.begin(), order.end(), cell) - order.begin();
        if (places.empty() || places.back() != place) places.push_back(place);
      }
      EXPECT_EQ(places.front(), 0u);
      EXPECT_TRUE(std::is_sorted(places.begin(), places.end())) << from.transpose() << " at " << angle;
      longest = std::max(longest, places.size());
    }
    EXPECT_GE(longest, static_cast<size_t>(std::max(grid.columns, grid.rows))) << "no ray that crosses the grid";
  }
}

TEST(BlockGrid, ConvertsToTheWorldAndBack) {
  BlockGrid grid = makeGrid(3, 2);
  grid.originInWorld = Vec3d(100, -20, 7);
  grid.gridFromWorld << 0, 1, 0, -1, 0, 0, 0, 0, 1;  // a quarter turn
  EXPECT_EQ(grid.inGrid(Vec3d(101, -20, 8)), Vec3d(0, -1, 1));
  EXPECT_EQ(grid.inWorld(Vec3d(0, -1, 1)), Vec3d(101, -20, 8));
}

}  // namespace
}  // namespace tessera
