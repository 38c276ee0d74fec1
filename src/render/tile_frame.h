// The coordinate frame of a tiled scene, and rays in it. Scene units are those of tiles/content.h.
#pragma once

#include <algorithm>

#include "scene/axes.h"

namespace tessera {

struct TileFrame {
  // A similarity: x_world = translation + scale · rotation · x_scene.
  Mat3d rotation = Mat3d::Identity();
  double scale = 1;  // world units of one scene unit
  Vec3d translation = Vec3d::Zero();
  Vec3d low = {-1, -1, -1},
        high = {1, 1, 1};  // the scene's box, scene units; the background block owns what lies outside
  double near = 0.05;      // scene units: no sample is closer to a camera

  static constexpr double kSceneEnd = 1e6;  // scene units: no sample is farther away

  Vec3d inScene(const Vec3d& xInWorld) const { return rotation.transpose() * (xInWorld - translation) / scale; }
};

// In scene units; the direction has length 1.
struct SceneRay {
  Vec3d origin = Vec3d::Zero(), direction = Vec3d::UnitZ();
};

// An interval of distances along a ray.
struct RayRange {
  double near = 0, far = 0;
  bool empty() const { return !(near < far); }
};

// Clips `range` to the part of the ray inside a box, whose sides may be infinite.
inline RayRange clipToBox(const SceneRay& ray, const Vec3d& low, const Vec3d& high, RayRange range) {
  for (int axis = 0; axis < 3; ++axis) {
    const double o = ray.origin[axis], d = ray.direction[axis];
    if (d == 0) {
      if (o < low[axis] || o >= high[axis]) return {range.near, range.near};
      continue;
    }
    const double a = (low[axis] - o) / d, b = (high[axis] - o) / d;
    range.near = std::max(range.near, std::min(a, b));
    range.far = std::min(range.far, std::max(a, b));
  }
  return range;
}

}  // namespace tessera
