#include "representations/mesh/train/through_rays.h"

#include <algorithm>

#include "base/random.h"
#include "train/scene_frame.h"

namespace tessera {
namespace {

std::vector<RayCamera> rayCameras(const Capture& capture, const SceneFrame& frame) {
  std::vector<RayCamera> cameras;
  for (const Photo& photo : capture.photos)
    cameras.push_back(makeRayCamera(capture.cameras[photo.camera], photo.worldFromCamera, frame));
  return cameras;
}

}  // namespace

ThroughRays::ThroughRays(Device& device, const Capture& capture, const SceneFrame& frame, TileShares tiles,
                         uint64_t seed, uint32_t maxRays)
    : device_(device),
      tiles_(std::move(tiles)),
      seed_(seed),
      cameras_(device.uploadArray(rayCameras(capture, frame))),
      photoOfRay_(device.array<uint32_t>(maxRays)),
      pixels_(device.array<float>(size_t{2} * maxRays)),
      origins_(device.array<float>(size_t{3} * maxRays)),
      directions_(device.array<float>(size_t{3} * maxRays)) {
  CHECK(!tiles_.tiles.empty());
}

void ThroughRays::draw(int64_t step, uint32_t rays) {
  CHECK(rays <= photoOfRay_.size());
  constexpr uint64_t kDrawsPerRay = 3;
  const RandomStream random(seed_, 0x7d20 + (static_cast<uint64_t>(step) << 16));
  std::vector<uint32_t> photos(rays);
  std::vector<float> pixels(size_t{2} * rays);
  for (size_t ray = 0; ray < rays; ++ray) {
    const double place = random.uniformDouble(kDrawsPerRay * ray) * tiles_.total();
    const size_t next =
        static_cast<size_t>(std::upper_bound(tiles_.until.begin(), tiles_.until.end(), place) - tiles_.until.begin());
    const PhotoTile& tile = tiles_.tiles[std::min(next, tiles_.tiles.size() - 1)];
    const uint32_t x = tile.left + random.below(kDrawsPerRay * ray + 1, tile.right - tile.left);
    const uint32_t y = tile.top + random.below(kDrawsPerRay * ray + 2, tile.bottom - tile.top);
    photos[ray] = static_cast<uint32_t>(tile.photo);
    pixels[2 * ray] = static_cast<float>(x) + 0.5f;
    pixels[2 * ray + 1] = static_cast<float>(y) + 0.5f;
  }
  count_ = rays;
  device_.write(photoOfRay_.all(), std::span<const uint32_t>(photos));
  device_.write(pixels_.all(), std::span<const float>(pixels));
  device_.run(GenerateRays{{rays, {}}, cameras_, photoOfRay_, pixels_, origins_, directions_});
}

MeshRays ThroughRays::rays() const {
  return {count_, origins_.part(0, size_t{3} * count_), directions_.part(0, size_t{3} * count_), {}};
}

}  // namespace tessera
