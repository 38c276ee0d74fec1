#include "partition/coverage.h"

#include <fmt/format.h>

#include <cmath>

#include "base/check.h"
#include "partition/ray_fan.h"

namespace tessera {
namespace {

bool isInSquare(const BlockGrid& grid, int cell, const Vec2d& xInGrid) {
  return (xInGrid - grid.centre(cell)).lpNorm<Eigen::Infinity>() <= grid.edge / 2 * (1 + 1e-9);
}

}  // namespace

std::vector<CellCoverage> countCoverage(const Capture& capture, const BlockGrid& grid, const Ground& ground,
                                        bool looksAtGround, const DepthOf& findRayDepth) {
  std::vector<RayFan> fans;
  for (const Camera& camera : capture.cameras) {
    fans.push_back(raysThroughMiddles(camera, kCoverageColumns, kCoverageRows));
  }
  const double groundInGrid = ground.height - ground.up().dot(grid.originInWorld);
  const auto cells = static_cast<size_t>(grid.cells());
  std::vector<CellCoverage> coverage(cells);
  std::vector<double> pixels(cells), pixelsBeyond(cells);
  std::vector<int> lastPhoto(cells, -1);
  for (const int photo : capture.photosIn(Split::train)) {
    const int camera = capture.photos[photo].camera;
    const RayFan& fan = fans[static_cast<size_t>(camera)];
    const Pose& pose = capture.photos[photo].worldFromCamera;
    const Mat3d gridFromCamera = grid.gridFromWorld * pose.rotation;
    const Vec3d origin = grid.inGrid(pose.translation);
    const double share = static_cast<double>(capture.cameras[camera].width) * capture.cameras[camera].height /
                         (kCoverageColumns * kCoverageRows);
    for (size_t ray = 0; ray < fan.pixels.size(); ++ray) {
      if (!fan.directionsInCamera[ray]) continue;
      const Vec3d direction = gridFromCamera * *fan.directionsInCamera[ray];
      double distance = findRayDepth ? findRayDepth(photo, fan.pixels[ray]) : 0;
      if (!(distance > 0)) {
        distance = !looksAtGround      ? -origin.dot(direction)
                   : direction.z() < 0 ? (groundInGrid - origin.z()) / direction.z()
                                       : 0;
      }
      const Vec3d end = origin + distance * direction;
      if (!(distance > 0) || !isPlace(end)) continue;
      const int owner = grid.cellAt(end.head<2>());
      const auto cell = static_cast<size_t>(owner);
      if (!isInSquare(grid, owner, end.head<2>())) {
        pixelsBeyond[cell] += share;
        continue;
      }
      pixels[cell] += share;
      coverage[cell].photos += lastPhoto[cell] != photo;
      lastPhoto[cell] = photo;
    }
  }
  for (size_t cell = 0; cell < cells; ++cell) {
    coverage[cell].pixels = std::llround(pixels[cell]);
    coverage[cell].pixelsBeyond = std::llround(pixelsBeyond[cell]);
  }
  return coverage;
}

std::vector<ThinCell> thinCells(const BlockGrid& grid, const std::vector<CellCoverage>& coverage,
                                const CoverageThresholds& enough) {
  CHECK(coverage.size() == static_cast<size_t>(grid.cells()));
  std::vector<ThinCell> thin;
  for (int cell = 0; cell < grid.cells(); ++cell) {
    const CellCoverage& has = coverage[static_cast<size_t>(cell)];
    if (has.photos >= enough.photos && has.pixels >= enough.pixels) continue;
    const Vec2d centre = grid.centre(cell);
    const Vec3d middle = grid.inWorld({centre.x(), centre.y(), 0});
    thin.push_back(
        {cell, fmt::format("block ({}, {}) around x {:.1f}, y {:.1f} is seen by {} training photos in {} pixels; {} "
                           "photos and {} pixels are the least: add photos of that place, or make blocks larger",
                           cell % grid.columns, cell / grid.columns, middle.x(), middle.y(), has.photos, has.pixels,
                           enough.photos, enough.pixels)});
  }
  return thin;
}

}  // namespace tessera
