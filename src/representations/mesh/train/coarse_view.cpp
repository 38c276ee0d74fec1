#include "representations/mesh/train/coarse_view.h"

#include <algorithm>
#include <cmath>

namespace tessera {

Camera strideCamera(const Camera& camera, double stride) {
  const auto strided = [&](int length) { return std::max(1, static_cast<int>(length / stride)); };
  return camera.scaledTo(strided(camera.width), strided(camera.height));
}

bool CoarseView::knowsDepth(int x, int y) const {
  constexpr double kLeastCosine = 1e-3;
  const auto inCamera = camera_.directionInCamera({x + 0.5, y + 0.5});
  return inCamera && std::abs(inCamera->z()) >= kLeastCosine * inCamera->norm();
}

std::optional<CoarseView::Surface> CoarseView::surfaceAt(int x, int y, float opacity) const {
  const float seen = *image_.opacity.at(x, y);
  if (!knowsDepth(x, y) || seen < opacity) return std::nullopt;
  const auto inCamera = camera_.directionInCamera({x + 0.5, y + 0.5});
  const double depth = *image_.depth.at(x, y) / seen;
  return Surface{depth, worldFromCamera_ * (*inCamera / inCamera->z() * depth)};
}

}  // namespace tessera
