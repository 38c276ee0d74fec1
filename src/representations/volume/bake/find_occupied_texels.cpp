// Finds the texels of a model that the training photos see.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/log.h"
#include "representations/volume/bake/bake_residency_schedule.h"
#include "representations/volume/bake/bake_volume.h"
#include "representations/volume/train/volume_pipeline.h"
#include "train/photo_visitor.h"

namespace tessera {
namespace {

constexpr uint32_t kRays = 2048;  // per batch
constexpr uint32_t kBesideTilesAcross = 32;
constexpr double kWarnFraction = 0.02;  // of the tiles are visited with several resident sets

VolumePipeline::Capacity rayCapacity(const VolumeModel& model) {
  BlockSamples maximum{model.space()};
  maximum.intervals = static_cast<uint32_t>(model.config().samples);
  maximum.split = true;
  VolumePipeline::Capacity capacity;
  capacity.rays = kRays;
  capacity.texels = VirtualGrid::kCorners * maximum.maxSamples(kRays);
  return capacity;
}

// Marks the samples that are visible through pixels: of all blocks, or of the background block alone.
class OccupiedTexelFinder final : public PixelVisitor {
 public:
  OccupiedTexelFinder(VolumeModel& model, const BakeOptions& options, std::vector<OccupiedTexels>& occupied)
      : model_(model),
        options_(options),
        occupied_(occupied),
        pipeline_(model, rayCapacity(model)),
        imageRays_(model.device(), kRays) {
    drawing_.minAlpha = static_cast<float>(options.minAlpha);
  }
  void begin(const Photo& photo, const Camera& camera) override {
    imageRays_.begin(makeRayCamera(camera, photo.worldFromCamera, model_.frame()), model_.frame(), {});
  }
  void visit(std::span<const float> pixels, SeenThrough through) override {
    const uint32_t firstBlock = through == SeenThrough::margin ? model_.space().cells() : 0;
    Device& device = model_.device();
    const ImageRays::Piece piece = imageRays_.through(pixels);
    pipeline_.forward({piece.rays, piece.origins, piece.directions, {}, {}, {}}, drawing_);
    const uint32_t samples = device.read(pipeline_.firstSample().part(piece.rays, 1))[0];
    const std::vector<float> weights = device.read(pipeline_.weights().part(0, samples));
    const std::vector<float> logDensities = device.read(pipeline_.logDensities().part(0, samples));
    const std::vector<float> steps = device.read(pipeline_.runtimeSteps().part(0, samples));
    const std::vector<float> positions = device.read(pipeline_.positions().part(0, size_t{3} * samples));
    const std::vector<uint32_t> slots = device.read(pipeline_.blockOfSample().part(0, samples));
    for (uint32_t s = 0; s < samples; ++s) {
      const uint32_t block = model_.blockOfSlot()[slots[s]];
      if (block < firstBlock || !(weights[s] > options_.minWeight)) continue;
      if (!(-std::expm1(-std::exp(logDensities[s]) * steps[s]) > options_.minAlpha)) continue;
      occupied_[block].mark(&positions[size_t{3} * s]);
    }
  }

 private:
  VolumeModel& model_;
  const BakeOptions& options_;
  std::vector<OccupiedTexels>& occupied_;
  VolumePipeline pipeline_;
  ImageRays imageRays_;
  VolumePipeline::Options drawing_;
};

// Returns the pixels of a lattice that lie in a tile. The tile's coordinates are relative to the lattice's first pixel.
PixelLattice cropLattice(const PixelLattice& whole, const PhotoTile& tile) {
  const auto next = [&](uint32_t from) {
    const int stride = whole.stride;
    return (static_cast<int>(from) + stride - 1) / stride * stride;
  };
  return {whole.firstX + next(tile.left), whole.firstY + next(tile.top), whole.firstX + static_cast<int>(tile.right),
          whole.firstY + static_cast<int>(tile.bottom), whole.stride};
}

// Returns tiles of the pixels of latticeBeside(), relative to its first pixel, without those that lie entirely within
// the photo.
std::vector<PhotoTile> tilesBeside(const Camera& camera, int photo) {
  const PixelLattice whole = latticeBeside(camera, 1);
  const uint32_t width = static_cast<uint32_t>(whole.endX - whole.firstX),
                 height = static_cast<uint32_t>(whole.endY - whole.firstY);
  const uint32_t edge = (std::max(width, height) + kBesideTilesAcross - 1) / kBesideTilesAcross;
  std::vector<PhotoTile> tiles;
  for (uint32_t top = 0; top < height; top += edge) {
    for (uint32_t left = 0; left < width; left += edge) {
      const uint32_t right = std::min(left + edge, width), bottom = std::min(top + edge, height);
      const bool within = whole.firstX + static_cast<int>(left) >= 0 && whole.firstY + static_cast<int>(top) >= 0 &&
                          whole.firstX + static_cast<int>(right) <= camera.width &&
                          whole.firstY + static_cast<int>(bottom) <= camera.height;
      if (!within) tiles.push_back({photo, left, top, right, bottom});
    }
  }
  return tiles;
}

// Returns, for each tile beside the photo, the resident set that has the most of the blocks in front of the background
// block, [tiles].
std::vector<uint32_t> residentSetsForMargin(const Capture& capture, int photo, const VolumeModel& model,
                                            const BakeResidencySchedule& residentSets) {
  const Pose& pose = capture.photos[photo].worldFromCamera;
  const Camera& camera = capture.cameras[capture.photos[photo].camera];
  const PixelLattice whole = latticeBeside(camera, 1);
  const Vec3d origin = model.frame().sceneFromWorld(pose.translation);
  std::vector<uint32_t> bestSets;
  for (const PhotoTile& tile : tilesBeside(camera, photo)) {
    const Vec2d middle(whole.firstX + (tile.left + tile.right) / 2.0, whole.firstY + (tile.top + tile.bottom) / 2.0);
    const auto direction = pixelDirection(middle, camera, pose, model.frame());
    std::vector<uint32_t> blocks;
    if (direction) blocks = cellsAlong(model.space(), origin, *direction, std::numeric_limits<double>::infinity());
    bestSets.push_back(residentSets.bestFor(blocks));
  }
  return bestSets;
}

class OutOfCorePhotoVisitor {
 public:
  OutOfCorePhotoVisitor(VolumeModel& model, const Capture& capture, const BakeOptions& options)
      : model_(model),
        capture_(capture),
        options_(options),
        backgroundBlock_(model.space().blocks() > model.space().cells()),
        tiled_(tilePhotos(capture, model.frame(), model.space())),
        residentSets_(tiled_, model.space().cells(), model.slots() - (backgroundBlock_ ? 1 : 0)) {
    for (const int photo : capture.photosIn(Split::train)) {
      photos_.push_back(photo);
      if (backgroundBlock_) beside_.push_back(residentSetsForMargin(capture, photo, model, residentSets_));
    }
    for (const uint32_t set : tiled_.setOfTile)
      plannedVisits_ += static_cast<int64_t>(residentSets_.residentSetsForSet(set).size());
  }
  double inParts() const { return residentSets_.inParts(); }
  void visitAll(PhotoVisitor& photos) {
    for (uint32_t residentSet = 0; residentSet < residentSets_.residentSets().size(); ++residentSet) {
      model_.ensureResident(residentSets_.residentSets()[residentSet]);
      visitDuring(residentSet, photos);
    }
  }

 private:
  void visitDuring(uint32_t residentSet, PhotoVisitor& photos) {
    size_t tile = 0;
    for (size_t k = 0; k < photos_.size(); ++k) {
      const Camera& camera = capture_.cameras[capture_.photos[photos_[k]].camera];
      std::vector<PixelLattice> within, beside;
      for (; tile < tiled_.tiles.size() && tiled_.tiles[tile].photo == photos_[k]; ++tile) {
        const std::vector<uint32_t>& in = residentSets_.residentSetsForSet(tiled_.setOfTile[tile]);
        if (std::find(in.begin(), in.end(), residentSet) == in.end()) continue;
        within.push_back(cropLattice(latticeWithin(camera, options_.stride), tiled_.tiles[tile]));
      }
      if (backgroundBlock_) {
        const std::vector<PhotoTile> tiles = tilesBeside(camera, photos_[k]);
        for (size_t i = 0; i < tiles.size(); ++i) {
          if (beside_[k][i] == residentSet)
            beside.push_back(cropLattice(latticeBeside(camera, options_.stride), tiles[i]));
        }
      }
      if (within.empty() && beside.empty()) continue;
      photos.begin(photos_[k]);
      photos.look(within, SeenThrough::photo, false);
      photos.look(beside, SeenThrough::margin, true);
      visits_ += static_cast<int64_t>(within.size());
      const int64_t all = static_cast<int64_t>(photos_.size());
      options_.onStep(all * visits_ / plannedVisits_, all);
    }
  }

  VolumeModel& model_;
  const Capture& capture_;
  const BakeOptions& options_;
  bool backgroundBlock_;
  TiledPhotos tiled_;
  BakeResidencySchedule residentSets_;
  std::vector<int> photos_;                    // training photos
  std::vector<std::vector<uint32_t>> beside_;  // [photos_][tiles beside]: the resident set
  int64_t plannedVisits_ = 0, visits_ = 0;     // of tiles
};

}  // namespace

std::vector<OccupiedTexels> findOccupiedTexels(VolumeModel& model, const Capture& capture, const BakeOptions& options) {
  std::vector<OccupiedTexels> occupied(model.space().blocks(), OccupiedTexels(model.virtualGrid()));
  OccupiedTexelFinder finder(model, options, occupied);
  PhotoVisitor photos(capture, model.frame(), kRays, finder);
  if (model.holdsAll()) {
    const bool backgroundBlock = model.space().blocks() > model.space().cells();
    photos.visitAll(options.stride, {backgroundBlock, false}, options.onStep);
    return occupied;
  }
  OutOfCorePhotoVisitor visitor(model, capture, options);
  if (model.config().lod == 0 && visitor.inParts() >= kWarnFraction) {
    warn(
        "{:.0f} % of what the photos show is seen through blocks that are not in memory together, and is visited in "
        "parts: the scene will contain some texels that are hidden there; raise --resident-blocks",
        100 * visitor.inParts());
  }
  visitor.visitAll(photos);
  return occupied;
}

}  // namespace tessera
