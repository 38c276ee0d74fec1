// Convex hulls and their smallest enclosing rectangles.
// Source: Andrew, "Another efficient algorithm for convex hulls in two dimensions", 1979; Freeman and Shapira,
// "Determining the minimum-area encasing rectangle for an arbitrary closed curve", 1975.
#pragma once

#include <vector>

#include "scene/axes.h"

namespace tessera {

// Returns twice the signed area of the triangle (0, a, b), positive where b lies counterclockwise of a.
inline double cross(const Vec2d& a, const Vec2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

struct Rectangle {
  Vec2d centre = Vec2d::Zero();
  double angle = 0;             // radians from the plane's x to the rectangle's x, within ±45°
  double width = 0, depth = 0;  // along its own x and y

  // Convert a point of the plane to the rectangle's own axes, from its centre along its sides, and back.
  Vec2d inside(const Vec2d& x) const { return Eigen::Rotation2Dd(-angle) * (x - centre); }
  Vec2d outside(const Vec2d& xInside) const { return centre + Eigen::Rotation2Dd(angle) * xInside; }
  bool holds(const Vec2d& x, double margin = 0) const {
    const Vec2d at = inside(x).cwiseAbs();
    return at.x() <= width / 2 + margin && at.y() <= depth / 2 + margin;
  }
};

// Returns the corners of the hull counterclockwise, without points on its edges; fewer than three if all points lie on
// a line.
std::vector<Vec2d> convexHull(std::vector<Vec2d> points);

// Returns the enclosing rectangle of smallest area. It is rotated only where that saves kWorthTurning of the area, so
// that regions aligned with the axes stay aligned. `hull` is a result of convexHull and must not be empty.
inline constexpr double kWorthTurning = 0.01;
Rectangle smallestRectangle(const std::vector<Vec2d>& hull);

}  // namespace tessera
