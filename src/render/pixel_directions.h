// The viewing directions of a camera's pixels.
#pragma once

#include <vector>

#include "base/threads.h"
#include "scene/camera.h"

namespace tessera {

// Directions in camera axes. Inverting the lens model is expensive, so the directions are cached while the camera stays
// the same.
class PixelDirections {
 public:
  PixelDirections() = default;
  PixelDirections(const Camera& camera, ThreadPool& pool) { update(camera, pool); }
  void update(const Camera& camera, ThreadPool& pool);

  const Camera& camera() const { return camera_; }
  // A unit vector; zero where the lens sees nothing.
  const Vec3f& at(int x, int y) const { return directions_[static_cast<size_t>(y) * camera_.width + x]; }

 private:
  Camera camera_;
  std::vector<Vec3f> directions_;
};

}  // namespace tessera
