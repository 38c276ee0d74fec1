#include "render/pixel_directions.h"

namespace tessera {

void PixelDirections::update(const Camera& camera, ThreadPool& pool) {
  if (!directions_.empty() && camera == camera_) return;
  camera_ = camera;
  directions_.assign(static_cast<size_t>(camera.width) * camera.height, Vec3f::Zero());
  pool.run(static_cast<size_t>(camera.height), [&](size_t y, int) {
    for (int x = 0; x < camera.width; ++x) {
      const auto direction = camera.directionInCamera(Vec2d(x + 0.5, static_cast<double>(y) + 0.5));
      if (direction) directions_[y * static_cast<size_t>(camera.width) + x] = direction->cast<float>();
    }
  });
}

}  // namespace tessera
