// For tests of what a renderer asks of its drawer: a root with 2×2 cells below it, whose contents hold the numbers of
// their tiles.
#pragma once

#include "render/testing/test_tree.h"
#include "render/tile_cache.h"
#include "render/tile_frame.h"
#include "scene/camera.h"
#include "tiles/content.h"

namespace tessera {

struct NumberedContent final : Content {
  explicit NumberedContent(int tile, uint64_t bytes) : tile(tile), bytes(bytes) {}
  uint64_t memoryBytes() const override { return bytes; }
  std::optional<std::string> mismatchWith(const TileContent&) const override { return std::nullopt; }

  int tile;
  uint64_t bytes;
  bool prepared = false;
};

struct NumberedPlace {
  static constexpr uint64_t kContentBytes = 100, kResourceBytes = 1000;

  NumberedPlace() {
    frame.low = Vec3d(-2, -2, -1);
    frame.high = Vec3d(2, 2, 1);
  }

  // All tiles except the root share one resource.
  TileSource<Content> source() const {
    TileSource<Content> source;
    source.bytes = [](int) { return kContentBytes; };
    source.load = [](int tile) { return std::make_unique<NumberedContent>(tile, kContentBytes); };
    source.tileResources = [](int tile) { return tile == 0 ? std::vector<int>() : std::vector<int>{0}; };
    source.bytesOfResource = [](int) { return kResourceBytes; };
    return source;
  }

  static Camera camera() {
    Camera camera;
    camera.width = 64;
    camera.height = 48;
    camera.parameters = {30, 30, 32, 24};
    return camera;
  }
  // A camera above the middle that looks down and sees the whole place.
  static Pose above() {
    Pose pose;
    pose.rotation = Eigen::Vector3d(1, -1, -1).asDiagonal();
    pose.translation = Vec3d(0, 0, 6);
    return pose;
  }

  TileTree tree = testTree(2, 2);
  TileFrame frame;
};

}  // namespace tessera
