// The grid of square blocks on the ground into which a large scene is divided (City-on-Web, section 4.1). Plain data,
// computed by src/partition and shared by training, tiles and renderers.
#pragma once

#include <vector>

#include "scene/axes.h"

namespace tessera {

// Grid axes: x and y along the cells' edges, z up, the origin at the centre of all cells. Lengths are in world units.
struct BlockGrid {
  Vec3d originInWorld = Vec3d::Zero();
  Mat3d gridFromWorld = Mat3d::Identity();  // a rotation
  double edge = 1;                          // of a cell
  int columns = 1, rows = 1;                // along x and y; cell (i, j) is number i + columns · j
  double bottom = -0.5, top = 0.5;          // grid heights that enclose the scene; at most `edge` apart

  int cells() const { return columns * rows; }
  Vec3d inGrid(const Vec3d& xInWorld) const { return gridFromWorld * (xInWorld - originInWorld); }
  Vec3d inWorld(const Vec3d& xInGrid) const { return gridFromWorld.transpose() * xInGrid + originInWorld; }
  // Returns the cell that contains a point; points outside the grid are clamped to its border.
  int cellAt(const Vec2d& xInGrid) const;
  Vec2d centre(int cell) const;  // in grid coordinates
  // Returns the cells in an order that is front to back for every ray from `xInGrid`: sorted by the distance of their
  // indices, |di| + |dj|, from the (clamped) cell of `xInGrid`. That distance never decreases along a ray.
  std::vector<int> frontToBack(const Vec2d& xInGrid) const;
};

}  // namespace tessera
