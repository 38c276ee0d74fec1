// Rays in the coordinates of grids of octahedra.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "compute/octahedra.h"

namespace tessera::cpu {

// A ray in homogeneous coordinates of the grid: start + t · slope.
struct HomogeneousRay {
  double start[4], slope[4];

  HomogeneousRay(const OctahedraGrid& grid, const float* origin, const float* direction) {
    for (int row = 0; row < 4; ++row) {
      const float* const m = grid.gridFromScene.data() + 4 * row;
      start[row] = m[3];
      slope[row] = 0;
      for (int column = 0; column < 3; ++column) {
        start[row] += double{m[column]} * origin[column];
        slope[row] += double{m[column]} * direction[column];
      }
    }
  }
  // Limits [*begin, *end] to the box in which faces are hit. All six bounds are linear in t.
  void clip(const OctahedraGrid& grid, double* begin, double* end) const {
    for (int axis = 0; axis < 3; ++axis) {
      const double low = std::max(0.0f, grid.lowest[axis]);
      const double high = std::min(static_cast<float>(grid.resolution), grid.highest[axis]);
      for (const bool upper : {false, true}) {
        const double value = upper ? high * start[3] - start[axis] : start[axis] - low * start[3];
        const double rise = upper ? high * slope[3] - slope[axis] : slope[axis] - low * slope[3];
        if (rise > 0) {
          *begin = std::max(*begin, -value / rise);
        } else if (rise < 0) {
          *end = std::min(*end, -value / rise);
        } else if (value < 0) {
          *end = -std::numeric_limits<double>::infinity();
        }
      }
    }
  }
  double at(double t, int axis) const { return (start[axis] + t * slope[axis]) / (start[3] + t * slope[3]); }
  // The parameter at which a coordinate has the value g.
  double parameterAt(double g, int axis) const { return (g * start[3] - start[axis]) / (slope[axis] - g * slope[3]); }
};

// Returns the distance at which a ray leaves TraceOctahedra::boxInFront, or 0 if it does not cross it.
inline double distanceBehindBox(const std::array<float, 3>& halfEdges, const float* origin, const float* direction) {
  if (halfEdges == std::array<float, 3>{}) return 0;
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (std::abs(origin[axis]) > halfEdges[axis]) return 0;
      continue;
    }
    const double side = std::copysign(double{halfEdges[axis]}, double{direction[axis]});
    enter = std::max(enter, (-side - origin[axis]) / direction[axis]);
    leave = std::min(leave, (side - origin[axis]) / direction[axis]);
  }
  return enter < leave ? leave : 0;
}

}  // namespace tessera::cpu
