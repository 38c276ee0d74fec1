#include "partition/ray_fan.h"

namespace tessera {
namespace {

RayFan fan(const Camera& camera, int columns, int rows, double offset, const Vec2d& step) {
  RayFan rays;
  rays.columns = columns;
  rays.rows = rows;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Vec2d pixel((column + offset) * step.x(), (row + offset) * step.y());
      rays.pixels.push_back(pixel);
      rays.directionsInCamera.push_back(camera.directionInCamera(pixel));
    }
  }
  return rays;
}

}  // namespace

RayFan raysThroughMiddles(const Camera& camera, int columns, int rows) {
  return fan(camera, columns, rows, 0.5,
             {static_cast<double>(camera.width) / columns, static_cast<double>(camera.height) / rows});
}

RayFan raysThroughCorners(const Camera& camera, int columns, int rows) {
  return fan(camera, columns + 1, rows + 1, 0,
             {static_cast<double>(camera.width) / columns, static_cast<double>(camera.height) / rows});
}

}  // namespace tessera
