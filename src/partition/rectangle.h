// Convex hulls and the smallest rectangle about them.
// Source: Andrew, "Another efficient algorithm for convex hulls in two dimensions", 1979; Freeman and Shapira,
// "Determining the minimum-area encasing rectangle for an arbitrary closed curve", 1975.
#pragma once

#include <vector>

#include "scene/axes.h"

namespace tessera {

// Twice the area of the triangle (0, a, b), positive where b lies counterclockwise of a.
inline double cross(const Vec2d& a, const Vec2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

struct Rectangle {
  Vec2d centre = Vec2d::Zero();
  double angle = 0;             // radians from the plane's x to the rectangle's, within ±45°
  double width = 0, depth = 0;  // along its own x and y

  // Of a point of the plane, from the rectangle's centre along its sides.
  Vec2d inside(const Vec2d& x) const { return Eigen::Rotation2Dd(-angle) * (x - centre); }
  Vec2d outside(const Vec2d& xInside) const { return centre + Eigen::Rotation2Dd(angle) * xInside; }
  bool holds(const Vec2d& x, double margin = 0) const {
    const Vec2d at = inside(x).cwiseAbs();
    return at.x() <= width / 2 + margin && at.y() <= depth / 2 + margin;
  }
};

// Counterclockwise, without points on its edges. Fewer than three points when all lie on a line.
std::vector<Vec2d> convexHull(std::vector<Vec2d> points);

// Of the smallest area. It is turned only where that saves kWorthTurning of the area, so that places that are square to
// the axes stay so. `hull` as convexHull makes it, not empty.
inline constexpr double kWorthTurning = 0.01;
Rectangle smallestRectangle(const std::vector<Vec2d>& hull);

}  // namespace tessera
