#include "representations/mesh/train/extraction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "representations/mesh/content/patch_texels.h"
#include "train/photo_visitor.h"

namespace tessera {
namespace {

constexpr uint32_t kMiddlesAtOnce = 1 << 17;
// The directions of parallel rays count only for faces that no photo shows.
constexpr float kParallelWeight = 1e-4f;
constexpr uint32_t kAzimuths = 8;
constexpr double kElevations[] = {60, 45, 30};  // degrees above the horizon from which parallel rays come

// Follows the rays through the pixels of photos.
class PhotoFaces final : public PixelVisitor {
 public:
  PhotoFaces(MeshModel& model, RayFollower& follower)
      : model_(model), follower_(follower), imageRays_(model.device(), follower.maxRays()) {}

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
      if (origins.size() == size_t{3} * follower.maxRays()) follow();
    }
  }
  follow();
}

// Counts the rays that stay mostly transparent.
class HoleCounter final : public RayFollower {
 public:
  explicit HoleCounter(MeshModel& model)
      : RayFollower(model.device()),
        model_(model),
        hits_(model.device(), maxRays(), maxSamples()),
        counters_(model.device().array<uint32_t>(MeshHits::kCounters)),
        logits_(model.device().array<float>(maxSamples())) {
    hits_.counters = counters_;
    coverage_.part = model.part().name;
    model.field().reserve(maxSamples());
  }

  uint32_t follow(const MeshRays& rays, float) override {
    Device& device = model_.device();
    model_.level(0).trace(rays, kMaxHits, false, hits_);
    model_.field().encode(hits_.samples(), hits_.positions, Matrix<float>(logits_, 1));
    const std::vector<uint32_t> counters = device.read(counters_.all());
    const uint32_t followed = counters[1];
    CHECK(followed >= 1u);  // one ray's hits always fit
    const auto [first, logits] = device.readAll(Slice<const uint32_t>(hits_.firstSample.part(0, followed + size_t{1})),
                                                Slice<const float>(logits_.part(0, counters[0])));
    for (uint32_t ray = 0; ray < followed; ++ray) {
      float transmittance = 1;
      for (uint32_t i = first[ray]; i < first[ray + 1]; ++i)
        transmittance *= 1 - storedOpacity(1 / (1 + std::exp(-logits[i] - model_.opacityOffset())),
                                           StoredOpacity::kOpaqueFrom, StoredOpacity::kTransparentBelow);
      ++coverage_.pixels;
      coverage_.holes += transmittance > 0.5f ? 1 : 0;
    }
    return followed;
  }
  const SurfaceCoverage& coverage() const { return coverage_; }

 private:
  MeshModel& model_;
  MeshHits hits_;
  Array<uint32_t> counters_;
  Array<float> logits_;
  SurfaceCoverage coverage_;
};

// Adds the neighbours of the faces that are opaque enough in their middle.
void addNeighbours(MeshModel& model, uint32_t level, float minOpacity, FaceSet& faces) {
  Device& device = model.device();
  const OctahedraDomain& domain = model.level(level).domain();
  const std::vector<float> displacements = device.read(model.level(level).displacements().values.all());
  const uint32_t n = domain.grids[0].resolution, cells = domain.grids[0].cells();
  std::vector<uint32_t> neighbours = faces.neighbours(domain.grids).numbers();
  if (model.config().quads) {
    const FaceSet quads = FaceSet::quads(domain.grids);
    std::erase_if(neighbours, [&](uint32_t face) { return !quads.contains(face); });
  }
  Array<float> positions = device.array<float>(size_t{3} * kMiddlesAtOnce),
               logits = device.array<float>(kMiddlesAtOnce);
  model.field().reserve(kMiddlesAtOnce);
  for (size_t begin = 0; begin < neighbours.size(); begin += kMiddlesAtOnce) {
    const auto some = std::span(neighbours).subspan(begin, std::min<size_t>(kMiddlesAtOnce, neighbours.size() - begin));
    std::vector<float> middles(size_t{3} * kMiddlesAtOnce);
    for (size_t i = 0; i < some.size(); ++i) {
      const OctahedraGrid& grid = domain.grids[some[i] / kFacesPerCell / cells];
      for (const auto& corner : octahedronFace(some[i] % kFacesPerCell)) {
        const int64_t step = corner[0] + int64_t{n} * (corner[1] + int64_t{n} * corner[2]);
        const size_t vertex = static_cast<size_t>(int64_t{some[i] / kFacesPerCell} + step);
        const size_t cell = vertex % cells;
        const size_t place[3] = {cell % n, cell / n % n, cell / (size_t{n} * n)};
        for (size_t axis = 0; axis < 3; ++axis)
          middles[3 * i + axis] +=
              (static_cast<float>(place[axis]) + 0.5f + displacements[3 * vertex + axis] + grid.positionOffset[axis]) *
              grid.positionScale() / 3;
      }
    }
    device.write(positions.all(), std::span<const float>(middles));
    model.field().encode({static_cast<uint32_t>(some.size())}, positions, Matrix<float>(logits, 1));
    const std::vector<float> values = device.read(logits.part(0, some.size()));
    for (size_t i = 0; i < some.size(); ++i)
      if (1 / (1 + std::exp(-values[i] - model.opacityOffset())) >= minOpacity) faces.add(some[i]);
  }
}

}  // namespace

FaceMarker::FaceMarker(MeshModel& model, uint32_t level, const ExtractionSettings& settings)
    : RayFollower(model.device()),
      model_(model),
      level_(level),
      settings_(settings),
      faces_(model.level(level).domain().grids),
      hits_(model.device(), maxRays(), maxSamples()),
      counters_(model.device().array<uint32_t>(MeshHits::kCounters)),
      logits_(model.device().array<float>(maxSamples())) {
  hits_.counters = counters_;
  model.field().reserve(maxSamples());
}

uint32_t FaceMarker::follow(const MeshRays& rays, float weight) {
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
  PhotoVisitor visitor(capture, model.frame(), follower.maxRays(), faces);
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

SurfaceCoverage checkCoverage(MeshModel& model, const Capture& capture, const std::vector<TileShares>& tiles) {
  HoleCounter counter(model);
  PhotoFaces middles(model, counter);
  PhotoVisitor visitor(capture, model.frame(), counter.maxRays(), middles);
  for (const int photo : capture.photosIn(Split::train)) {
    std::vector<PixelLattice> lattices;
    for (const PhotoTile& tile : tiles[photo].tiles) {
      const int x = static_cast<int>(tile.left + tile.right) / 2, y = static_cast<int>(tile.top + tile.bottom) / 2;
      lattices.push_back({x, y, x + 1, y + 1, 1});
    }
    if (lattices.empty()) continue;
    visitor.begin(photo);
    visitor.look(lattices, SeenThrough::photo, false);
  }
  return counter.coverage();
}

FaceSet extractFaces(MeshModel& model, uint32_t level, const Capture& capture, const std::vector<TileShares>* tiles,
                     const ExtractionSettings& settings, const std::function<void(int64_t, int64_t)>& onPhoto) {
  FaceMarker marker(model, level, settings);
  followRays(model, level, capture, tiles, settings, marker, onPhoto);
  FaceSet faceSet = marker.faces();
  faceSet.dropLeast(settings.droppedShare);
  for (int i = 0; i < settings.dilation; ++i) addNeighbours(model, level, settings.minOpacity, faceSet);
  return faceSet;
}

}  // namespace tessera
