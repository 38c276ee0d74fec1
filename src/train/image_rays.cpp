#include "train/image_rays.h"

#include <algorithm>
#include <limits>

namespace tessera {

ImageBatch ImageBatch::on(const Device& device) {
  const bool isGpu = device.ownMemory().bytes > 0;
  return isGpu ? ImageBatch{1 << 14, 1 << 18} : ImageBatch{};
}

ImageRays::ImageRays(Device& device, uint32_t maxRays)
    : device_(device),
      maxRays_(maxRays),
      camera_(device.array<RayCamera>(1)),
      cameraOfRay_(device.array<uint32_t>(maxRays)),
      pixels_(device.array<float>(size_t{2} * maxRays)),
      origins_(device.array<float>(size_t{3} * maxRays)),
      directions_(device.array<float>(size_t{3} * maxRays)),
      far_(device.array<float>(maxRays)) {}

void ImageRays::begin(const RayCamera& camera, const SceneFrame& frame, const PixelLattice& lattice,
                      const ImageF* opaqueDepth) {
  device_.write(camera_.all(), std::span<const RayCamera>(&camera, 1));
  lattice_ = lattice;
  opaqueDepth_ = opaqueDepth;
  for (int axis = 0; axis < 3; ++axis) forward_[axis] = camera.rotation[3 * axis + 2];
  scale_ = static_cast<float>(frame.scale);
}

float ImageRays::cosine(uint32_t ray) const {
  const float* direction = &hostDirections_[size_t{3} * ray];
  return direction[0] * forward_[0] + direction[1] * forward_[1] + direction[2] * forward_[2];
}

ImageRays::Piece ImageRays::piece(size_t first, uint32_t maximum) {
  const uint32_t rays = static_cast<uint32_t>(std::min<size_t>(std::min(maximum, maxRays_), lattice_.count() - first));
  std::vector<float> pixels, far;
  for (size_t i = first; i < first + rays; ++i) {
    const int x = lattice_.firstX + static_cast<int>(i % lattice_.columns()) * lattice_.stride;
    const int y = lattice_.firstY + static_cast<int>(i / lattice_.columns()) * lattice_.stride;
    pixels.push_back(static_cast<float>(x) + 0.5f);
    pixels.push_back(static_cast<float>(y) + 0.5f);
    if (opaqueDepth_) far.push_back(*opaqueDepth_->at(x, y));
  }
  Piece result = through(pixels);
  if (!opaqueDepth_) return result;
  for (uint32_t ray = 0; ray < rays; ++ray) {
    const float along = cosine(ray);
    far[ray] = along > 0 ? far[ray] * scale_ / along : std::numeric_limits<float>::infinity();
  }
  device_.write(far_.all(), std::span<const float>(far));
  result.far = far_;
  return result;
}

void ImageRays::renderInPieces(uint32_t sampleCapacity, const std::function<Rendered(const Piece&, size_t)>& render) {
  constexpr double kFirst = 1024, kLeast = 64, kFull = 0.9;
  double next = kFirst;  // rays of the next piece, predicted from the samples of the last one
  for (size_t first = 0; first < lattice_.count();) {
    const double limit = std::clamp(next, std::min<double>(kLeast, maxRays_), static_cast<double>(maxRays_));
    const Rendered rendered = render(piece(first, static_cast<uint32_t>(limit)), first);
    CHECK(rendered.rays >= 1u);
    first += rendered.rays;
    next = kFull * sampleCapacity / std::max(1.0, rendered.samples / static_cast<double>(rendered.rays));
  }
}

ImageRays::Piece ImageRays::through(std::span<const float> pixels) {
  const uint32_t rays = static_cast<uint32_t>(pixels.size() / 2);
  CHECK(rays <= maxRays_);
  device_.write(pixels_.all(), pixels);
  device_.run(GenerateRays{{rays, {}}, camera_, cameraOfRay_, pixels_, origins_, directions_});
  hostDirections_ = device_.read(directions_.part(0, size_t{3} * rays));
  return {rays, origins_, directions_, {}};
}

}  // namespace tessera
