// Square blocks on the ground (City-on-Web, section 4.1): how a large place is cut up. Plain data; src/partition makes
// it, and training, tiles and renderers agree on it.
#pragma once

#include <vector>

#include "scene/axes.h"

namespace tessera {

// Grid axes: x and y along the cells' edges, z up, the origin amid all cells; one unit is one of the world.
struct BlockGrid {
  Vec3d originInWorld = Vec3d::Zero();
  Mat3d gridFromWorld = Mat3d::Identity();  // a rotation
  double edge = 1;                          // of a cell
  int columns = 1, rows = 1;                // along x and y; cell (i, j) is number i + columns · j
  double bottom = -0.5, top = 0.5;          // grid heights between which everything stands; at most `edge` apart

  int cells() const { return columns * rows; }
  Vec3d inGrid(const Vec3d& xInWorld) const { return gridFromWorld * (xInWorld - originInWorld); }
  Vec3d inWorld(const Vec3d& xInGrid) const { return gridFromWorld.transpose() * xInGrid + originInWorld; }
  // The cell of a place, clamped to the border.
  int cellAt(const Vec2d& xInGrid) const;
  Vec2d centre(int cell) const;  // in the grid
  // Cells in an order that is front to back for every ray from `xInGrid`: by the distance of their indices |di| + |dj|
  // from its (clamped) cell, which grows along any ray.
  std::vector<int> frontToBack(const Vec2d& xInGrid) const;
};

}  // namespace tessera
