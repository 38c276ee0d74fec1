// For tests: a whole scene of synthetic contents, with its tile tree, background block and tile source.
#pragma once

#include "render/testing/source_of_copies.h"
#include "render/testing/test_tree.h"
#include "render/tile_cache.h"
#include "render/tile_frame.h"
#include "representations/volume/testing/test_volume_content.h"
#include "scene/camera.h"

namespace tessera {

// 4 × 4 cells of smooth random texels. Coarser levels have the resolution of their level, and one part for each cell
// that they cover.
struct Place {
  TileTree tree = testTree(4, 4);
  std::vector<VolumeContent> contents;
  TileFrame frame;
  uint64_t allBytes = 0, coarsestBytes = 0, finestBytes = 0;

  Place() {
    frame.low = Vec3d(-4, -4, -1);
    frame.high = Vec3d(4, 4, 1);
    for (size_t i = 0; i < tree.tiles.size(); ++i) {
      TileNode& node = tree.tiles[i];
      std::vector<VolumePart> parts;
      for (double y = node.low.y(); y < node.high.y(); y += 2) {
        for (double x = node.low.x(); x < node.high.x(); x += 2) {
          VolumePart part;
          placeCell(part, static_cast<float>(x + 1), static_cast<float>(y + 1));
          part.voxels = 32 >> node.level;
          part.planes = 64 >> node.level;
          makeVolume(part, smoothVolume(static_cast<uint64_t>(7 * (x + 8) + y + 8), 0.4));
          parts.push_back(std::move(part));
        }
      }
      contents.push_back(makeVolumeContent(std::move(parts), randomNetwork(i)));
      node.geometricError = 2.0 / 64 * (1 << node.level);
      const uint64_t bytes = bytesInMemory(contents.back());
      allBytes += bytes;
      if (node.parent < 0) coarsestBytes = bytes;
      if (node.level == 0) finestBytes += bytes;
    }
    VolumePart around;
    around.contracted = around.backgroundBlock = true;
    around.scale = {4, 4, 1};
    around.voxels = 32;
    around.planes = 64;
    makeVolume(around, smoothVolume(1000, 0.2));
    contents.push_back(makeVolumeContent({around}, randomNetwork(1000)));
    tree.backgroundBlock = static_cast<int>(tree.tiles.size());
    tree.tiles.emplace_back().isBackgroundBlock = true;
    allBytes += bytesInMemory(contents.back());
    coarsestBytes += bytesInMemory(contents.back());
  }

  TileSource<Content> source() const {
    return sourceOfCopies([this](int tile) -> const VolumeContent& { return contents[tile]; });
  }
};

// A small camera, and its pose in each step of a flight over and through the scene.
inline Camera flightCamera() {
  Camera camera;
  camera.width = 64;
  camera.height = 48;
  camera.parameters = {60, 60, 32, 24};
  return camera;
}
inline Pose flightPose(int step) {
  const double angle = 0.021 * step;
  const Vec3d eye(5 * std::cos(angle), 4 * std::sin(1.7 * angle), 1.2 + std::sin(0.9 * angle));
  const Vec3d target(2 * std::sin(angle), std::cos(2 * angle), -0.5);
  Pose pose;
  const Vec3d forward = (target - eye).normalized(), right = forward.cross(Vec3d::UnitZ()).normalized();
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.translation = eye;
  return pose;
}

inline const Place& place() {
  static const Place instance;
  return instance;
}

}  // namespace tessera
