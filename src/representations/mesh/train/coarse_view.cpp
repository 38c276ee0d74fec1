#include "representations/mesh/train/coarse_view.h"

#include <algorithm>

namespace tessera {

Camera strideCamera(const Camera& camera, double stride) {
  const auto strided = [&](int length) { return std::max(1, static_cast<int>(length / stride)); };
  return camera.scaledTo(strided(camera.width), strided(camera.height));
}

std::optional<CoarseView::Surface> CoarseView::surfaceAt(int x, int y, float opacity) const {
  const auto inCamera = camera_.directionInCamera({x + 0.5, y + 0.5});
  const float seen = *image_.opacity.at(x, y);
  if (!inCamera || inCamera->z() <= 0 || seen < opacity) return std::nullopt;
  const double depth = *image_.depth.at(x, y) / seen;
  return Surface{depth, worldFromCamera_ * (*inCamera / inCamera->z() * depth)};
}

}  // namespace tessera
