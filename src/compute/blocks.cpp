#include "compute/blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

// The index of the cell that contains x if [-count, count] is divided into `count` cells, clamped.
uint32_t clampedCell(double x, uint32_t count) {
  const double cell = (x + count) / 2;
  if (!(cell > 0)) return 0;
  return cell < count ? static_cast<uint32_t>(cell) : count - 1;
}

}  // namespace

BlockSpace::Placement BlockSpace::placement(uint32_t block) const {
  CHECK(block < blocks());
  Placement place;
  if (block == cells()) {
    place.scale[0] = static_cast<float>(columns);
    place.scale[1] = static_cast<float>(rows);
    place.contracted = true;
    return place;
  }
  const uint32_t i = block % columns, j = block / columns;
  place.centre[0] = static_cast<float>(2 * i + 1) - static_cast<float>(columns);
  place.centre[1] = static_cast<float>(2 * j + 1) - static_cast<float>(rows);
  const bool atBorder = i == 0 || j == 0 || i + 1 == columns || j + 1 == rows;
  place.contracted = backgroundBlock == BackgroundBlockMode::border && atBorder;
  return place;
}

BlockSpace::Box BlockSpace::owned(uint32_t block) const {
  constexpr float kFar = static_cast<float>(kFarthest);
  if (block >= cells()) return {{-kFar, -kFar, -kFar}, {kFar, kFar, kFar}};
  const uint32_t i = block % columns, j = block / columns;
  const auto wall = [](uint32_t k, uint32_t count) { return 2.0f * static_cast<float>(k) - static_cast<float>(count); };
  Box box{{wall(i, columns), wall(j, rows), bottom}, {wall(i + 1, columns), wall(j + 1, rows), top}};
  if (placement(block).contracted) {
    if (i == 0) box.low[0] = -kFar;
    if (j == 0) box.low[1] = -kFar;
    if (i + 1 == columns) box.high[0] = kFar;
    if (j + 1 == rows) box.high[1] = kFar;
    box.low[2] = -kFar;
    box.high[2] = kFar;
  } else if (backgroundBlock == BackgroundBlockMode::border) {
    // Rays continue behind the box, and the block was trained up to the ends of its domain.
    box.low[2] = -1;
    box.high[2] = 1;
  }
  return box;
}

BlockSpace::Range BlockSpace::rangeInBox(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
                                         double near) const {
  const double low[3] = {-1.0 * columns, -1.0 * rows, bottom}, high[3] = {1.0 * columns, 1.0 * rows, top};
  Range range{near, std::numeric_limits<double>::infinity()};
  for (int axis = 0; axis < 3; ++axis) {
    const double o = origin[axis], d = direction[axis];
    if (d == 0) {
      if (o < low[axis] || o > high[axis]) range.far = 0;
      continue;
    }
    const double toLow = (low[axis] - o) / d, toHigh = (high[axis] - o) / d;
    range.near = std::max(range.near, std::min(toLow, toHigh));
    range.far = std::min(range.far, std::max(toLow, toHigh));
  }
  return range;
}

uint32_t BlockSpace::blockAt(double x, double y, double z) const {
  const bool inBox = std::abs(x) <= columns && std::abs(y) <= rows && z >= bottom && z <= top;
  if (backgroundBlock == BackgroundBlockMode::own && !inBox) return cells();
  return clampedCell(x, columns) + columns * clampedCell(y, rows);
}

double BlockSpace::distanceAt(double s, double near, double far) const {
  if (backgroundBlock == BackgroundBlockMode::none) return near + s * (far - near);
  if (s <= kBoxShare) return near + s / kBoxShare * (far - near);
  const double u = (s - kBoxShare) / (1 - kBoxShare);
  return 1 / ((1 - u) / far + u / kFarthest);
}

double BlockSpace::shareAt(double t, double near, double far) const {
  if (backgroundBlock == BackgroundBlockMode::none) return (t - near) / (far - near);
  if (t <= far) return kBoxShare * ((t - near) / (far - near));
  return kBoxShare + (1 - kBoxShare) * ((1 / far - 1 / t) / (1 / far - 1 / kFarthest));
}

}  // namespace tessera
