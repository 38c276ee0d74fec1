#include "representations/mesh/train/extraction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "train/photo_visitor.h"

namespace tessera {
namespace {

constexpr uint32_t kExtractionSamples = 1 << 17;
// The directions of parallel rays count only for faces that no photo shows.
constexpr float kParallelWeight = 1e-4f;
constexpr uint32_t kAzimuths = 8;
constexpr double kElevations[] = {60, 45, 30};  // degrees above the horizon from which parallel rays come

// Follows the rays through the pixels of photos.
class PhotoFaces final : public PixelVisitor {
 public:
  PhotoFaces(MeshModel& model, RayFollower& follower)
      : model_(model), follower_(follower), imageRays_(model.device(), RayFollower::kMaxRays) {}

  void begin(const Photo& photo, const Camera& camera) override {
    imageRays_.begin(makeRayCamera(camera, photo.worldFromCamera, model_.frame()), model_.frame(), {});
  }
  void visit(std::span<const float> pixels, SeenThrough) override {
    while (!pixels.empty()) {  // rays whose hits do not fit are followed in the next batch
      const ImageRays::Piece piece = imageRays_.through(pixels);
      pixels = pixels.subspan(size_t{2} * follower_.follow({piece.rays, piece.origins, piece.directions, {}}, 1));
    }
  }

 private:
  MeshModel& model_;
  RayFollower& follower_;
  ImageRays imageRays_;
};

// Follows parallel rays through the region of interest, [-1,1]³, on a square lattice with the given spacing.
void markParallel(Device& device, RayFollower& follower, const Vec3d& direction, double spacing) {
  const Vec3d right = std::abs(direction.z()) > 0.9 ? Vec3d::UnitX() : direction.cross(Vec3d::UnitZ()).normalized();
  const Vec3d up = right.cross(direction);
  const double reach = std::sqrt(3.0);  // of the region, from its centre
  std::vector<float> origins, directions;
  const auto follow = [&] {
    std::span<const float> from(origins), along(directions);
    while (!from.empty()) {
      const Array<float> o = device.uploadArray(std::vector<float>(from.begin(), from.end())),
                         d = device.uploadArray(std::vector<float>(along.begin(), along.end()));
      const uint32_t followed = follower.follow({static_cast<uint32_t>(from.size() / 3), o, d, {}}, kParallelWeight);
      from = from.subspan(size_t{3} * followed);
      along = along.subspan(size_t{3} * followed);
    }
    origins.clear();
    directions.clear();
  };
  for (double y = -reach; y <= reach; y += spacing) {
    for (double x = -reach; x <= reach; x += spacing) {
      const Vec3d origin = x * right + y * up - 2 * reach * direction;
      for (int axis = 0; axis < 3; ++axis) {
        origins.push_back(static_cast<float>(origin[axis]));
        directions.push_back(static_cast<float>(direction[axis]));
      }
      if (origins.size() == size_t{3} * RayFollower::kMaxRays) follow();
    }
  }
  follow();
}

}  // namespace

FaceMarker::FaceMarker(MeshModel& model, uint32_t level, const ExtractionSettings& settings)
    : model_(model),
      level_(level),
      settings_(settings),
      faces_(model.level(level).domain().grids),
      hits_(model.device(), kMaxRays, kExtractionSamples),
      counters_(model.device().array<uint32_t>(MeshHits::kCounters)),
      logits_(model.device().array<float>(kExtractionSamples)) {
  hits_.counters = counters_;
  model.field().reserve(kExtractionSamples);
}

uint32_t FaceMarker::follow(const MeshRays& rays, float weight) {
  constexpr uint32_t kMaxHits = 1024;  // of a ray
  Device& device = model_.device();
  model_.level(level_).trace(rays, kMaxHits, false, hits_);
  model_.field().encode(hits_.samples(), hits_.positions, Matrix<float>(logits_, 1));
  const std::vector<uint32_t> counters = device.read(counters_.all());
  const uint32_t followed = counters[1];
  CHECK(followed >= 1u);  // one ray's hits always fit
  const std::vector<float> directions = device.read(rays.directions.part(0, size_t{3} * followed));
  const auto [first, faces, logits] = device.readAll(
      Slice<const uint32_t>(hits_.firstSample.part(0, followed + size_t{1})),
      Slice<const uint32_t>(hits_.faces.part(0, counters[0])), Slice<const float>(logits_.part(0, counters[0])));
  for (uint32_t ray = 0; ray < followed; ++ray) {
    float transmittance = 1;
    const Vec3f direction = Vec3f(directions[3 * ray], directions[3 * ray + 1], directions[3 * ray + 2]).normalized();
    for (uint32_t i = first[ray]; i < first[ray + 1] && 1 - transmittance <= settings_.maxOpacity; ++i) {
      const float opacity = 1 / (1 + std::exp(-logits[i] - model_.opacityOffset()));
      if (opacity >= settings_.minOpacity)
        faces_.add(faces[i], weight * transmittance * opacity * direction, transmittance * opacity);
      transmittance *= 1 - opacity;
    }
  }
  return followed;
}

void followRays(MeshModel& model, uint32_t level, const Capture& capture, const std::vector<TileShares>* tiles,
                const ExtractionSettings& settings, RayFollower& follower,
                const std::function<void(int64_t, int64_t)>& onPhoto) {
  PhotoFaces faces(model, follower);
  PhotoVisitor visitor(capture, model.frame(), RayFollower::kMaxRays, faces);
  if (tiles == nullptr) {
    visitor.visitAll(settings.photoStride, {}, onPhoto);
  } else {
    const std::vector<int> photos = capture.photosIn(Split::train);
    int64_t done = 0;
    for (const int photo : photos) {
      std::vector<PixelLattice> lattices;
      for (const PhotoTile& tile : (*tiles)[photo].tiles) {
        lattices.push_back({static_cast<int>(tile.left), static_cast<int>(tile.top), static_cast<int>(tile.right),
                            static_cast<int>(tile.bottom), settings.photoStride});
      }
      if (!lattices.empty()) {
        visitor.begin(photo);
        visitor.look(lattices, SeenThrough::photo, false);
      }
      onPhoto(++done, static_cast<int64_t>(photos.size()));
    }
  }
  if (settings.raysPerCell > 0) {
    const double spacing = 2.0 / model.level(level).domain().grids[0].resolution / settings.raysPerCell;
    markParallel(model.device(), follower, -Vec3d::UnitZ(), spacing);
    for (const double degrees : kElevations) {
      const double elevation = degrees * std::numbers::pi / 180;
      for (uint32_t k = 0; k < kAzimuths; ++k) {
        const double azimuth = 2 * std::numbers::pi * k / kAzimuths;
        markParallel(
            model.device(), follower,
            {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), -std::sin(elevation)},
            spacing);
      }
    }
  }
}

FaceSet extractFaces(MeshModel& model, uint32_t level, const Capture& capture, const std::vector<TileShares>* tiles,
                     const ExtractionSettings& settings, const std::function<void(int64_t, int64_t)>& onPhoto) {
  FaceMarker marker(model, level, settings);
  followRays(model, level, capture, tiles, settings, marker, onPhoto);
  FaceSet faceSet = marker.faces();
  faceSet.dropLeast(settings.droppedShare);
  return faceSet;
}

}  // namespace tessera
