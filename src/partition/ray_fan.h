// Rays of a camera on a coarse lattice over its picture, undistorted once for all its photos.
#pragma once

#include <optional>
#include <vector>

#include "scene/camera.h"

namespace tessera {

struct RayFan {
  int columns = 0, rows = 0;
  std::vector<Vec2d> pixels;                             // [rows][columns]
  std::vector<std::optional<Vec3d>> directionsInCamera;  // unit; nothing where the lens has no inverse

  const std::optional<Vec3d>& at(int column, int row) const {
    return directionsInCamera[static_cast<size_t>(row) * static_cast<size_t>(columns) + static_cast<size_t>(column)];
  }
};

// Through the middles of columns × rows equal parts of the picture.
RayFan raysThroughMiddles(const Camera& camera, int columns, int rows);
// Through their corners: (columns + 1) × (rows + 1) rays, the outermost on the picture's border.
RayFan raysThroughCorners(const Camera& camera, int columns, int rows);

}  // namespace tessera
