// The rays of a camera on a coarse lattice over its image, undistorted once for all photos of the camera.
#pragma once

#include <optional>
#include <vector>

#include "scene/camera.h"

namespace tessera {

struct RayFan {
  int columns = 0, rows = 0;
  std::vector<Vec2d> pixels;                             // [rows][columns]
  std::vector<std::optional<Vec3d>> directionsInCamera;  // unit length; nothing where the lens has no inverse

  const std::optional<Vec3d>& at(int column, int row) const {
    return directionsInCamera[static_cast<size_t>(row) * static_cast<size_t>(columns) + static_cast<size_t>(column)];
  }
};

// Returns the rays through the centres of columns × rows equal parts of the image.
RayFan raysThroughMiddles(const Camera& camera, int columns, int rows);
// Returns the rays through the corners of those parts: (columns + 1) × (rows + 1) rays, the outermost on the image's
// border.
RayFan raysThroughCorners(const Camera& camera, int columns, int rows);

}  // namespace tessera
