#include "partition/rectangle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"

namespace tessera {
namespace {

// Reduces an angle to ±45°, because rotating a rectangle by a right angle only swaps its sides.
double reduced(double angle) {
  constexpr double kRight = std::numbers::pi / 2;
  return angle - kRight * std::round(angle / kRight);
}

Rectangle boxAt(const std::vector<Vec2d>& hull, double angle) {
  const Eigen::Rotation2Dd turn(-angle);
  Vec2d low = turn * hull[0], high = low;
  for (const Vec2d& point : hull) {
    const Vec2d at = turn * point;
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  const Vec2d size = high - low;
  return {turn.inverse() * ((low + high) / 2), angle, size.x(), size.y()};
}

}  // namespace

std::vector<Vec2d> convexHull(std::vector<Vec2d> points) {
  std::sort(points.begin(), points.end(),
            [](const Vec2d& a, const Vec2d& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Vec2d> hull;
  for (int side = 0; side < 2; ++side) {
    const size_t begin = hull.size();
    for (const Vec2d& point : points) {
      while (hull.size() >= begin + 2 && cross(hull.back() - hull[hull.size() - 2], point - hull.back()) <= 0) {
        hull.pop_back();
      }
      hull.push_back(point);
    }
    hull.pop_back();  // it is also the first of the other side
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

Rectangle smallestRectangle(const std::vector<Vec2d>& hull) {
  CHECK(hull.size() > 0u);
  // One side of the smallest rectangle lies on an edge of the hull. The hulls have few corners, so every edge is tested
  // against all of them.
  const Rectangle level = boxAt(hull, 0);
  Rectangle best = level;
  for (size_t i = 0; i < hull.size(); ++i) {
    const Vec2d edge = hull[(i + 1) % hull.size()] - hull[i];
    const Rectangle box = boxAt(hull, reduced(std::atan2(edge.y(), edge.x())));
    if (box.width * box.depth < best.width * best.depth) best = box;
  }
  return best.width * best.depth < (1 - kWorthTurning) * level.width * level.depth ? best : level;
}

}  // namespace tessera
