#include "scene/block_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

namespace tessera {
namespace {

int clampedIndex(double x, double edge, int count) {
  const double index = std::floor(x / edge + 0.5 * count);
  return static_cast<int>(std::clamp(index, 0.0, static_cast<double>(count - 1)));
}

}  // namespace

int BlockGrid::cellAt(const Vec2d& xInGrid) const {
  return clampedIndex(xInGrid.x(), edge, columns) + columns * clampedIndex(xInGrid.y(), edge, rows);
}

Vec2d BlockGrid::centre(int cell) const {
  return edge * Vec2d(cell % columns + 0.5 - 0.5 * columns, cell / columns + 0.5 - 0.5 * rows);
}

std::vector<int> BlockGrid::frontToBack(const Vec2d& xInGrid) const {
  const int from = cellAt(xInGrid);
  std::vector<int> order(static_cast<size_t>(cells()));
  std::iota(order.begin(), order.end(), 0);
  const auto distance = [&](int cell) {
    return std::abs(cell % columns - from % columns) + std::abs(cell / columns - from / columns);
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return distance(a) < distance(b); });
  return order;
}

}  // namespace tessera
