// What training photos see of a model.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/log.h"
#include "representations/volume/bake/bake_stays.h"
#include "representations/volume/bake/bake_volume.h"
#include "representations/volume/train/volume_pass.h"
#include "train/photo_visitor.h"

namespace tessera {
namespace {

constexpr uint32_t kRays = 2048;  // of one piece of a photo
constexpr uint32_t kBesideTilesAcross = 32;
constexpr double kWorthSaying = 0.02;  // of the tiles are looked through in several stays

VolumePass::Room roomForRays(const VolumeModel& model) {
  BlockSamples most{model.space()};
  most.intervals = static_cast<uint32_t>(model.config().samples);
  most.split = true;
  VolumePass::Room room;
  room.rays = kRays;
  room.texels = VirtualGrid::kCorners * most.mostSamples(kRays);
  return room;
}

// Marks what is seen through pixels: of all blocks, or of the surround alone.
class AliveFinder final : public PixelVisitor {
 public:
  AliveFinder(VolumeModel& model, const BakeOptions& options, std::vector<AliveTexels>& alive)
      : model_(model),
        options_(options),
        alive_(alive),
        pass_(model, roomForRays(model)),
        pictureRays_(model.device(), kRays) {
    drawing_.minAlpha = static_cast<float>(options.minAlpha);
  }
  void begin(const Photo& photo, const Camera& camera) override {
    pictureRays_.begin(makeRayCamera(camera, photo.worldFromCamera, model_.frame()), model_.frame(), {});
  }
  void visit(std::span<const float> pixels, SeenThrough through) override {
    const uint32_t firstBlock = through == SeenThrough::margin ? model_.space().cells() : 0;
    Device& device = model_.device();
    const PictureRays::Piece piece = pictureRays_.through(pixels);
    pass_.forward({piece.rays, piece.origins, piece.directions, {}, {}, {}}, drawing_);
    const uint32_t samples = device.read(pass_.firstSample().part(piece.rays, 1))[0];
    const std::vector<float> weights = device.read(pass_.weights().part(0, samples));
    const std::vector<float> logDensities = device.read(pass_.logDensities().part(0, samples));
    const std::vector<float> steps = device.read(pass_.runtimeSteps().part(0, samples));
    const std::vector<float> positions = device.read(pass_.positions().part(0, size_t{3} * samples));
    const std::vector<uint32_t> slots = device.read(pass_.blockOfSample().part(0, samples));
    for (uint32_t s = 0; s < samples; ++s) {
      const uint32_t block = model_.blockOfSlot()[slots[s]];
      if (block < firstBlock || !(weights[s] > options_.minWeight)) continue;
      if (!(-std::expm1(-std::exp(logDensities[s]) * steps[s]) > options_.minAlpha)) continue;
      alive_[block].mark(&positions[size_t{3} * s]);
    }
  }

 private:
  VolumeModel& model_;
  const BakeOptions& options_;
  std::vector<AliveTexels>& alive_;
  VolumePass pass_;
  PictureRays pictureRays_;
  VolumePass::Options drawing_;
};

// Those pixels of a lattice that lie in a tile, whose pixels count from the lattice's first.
PixelLattice partOf(const PixelLattice& whole, const PhotoTile& tile) {
  const auto next = [&](uint32_t from) {
    const int stride = whole.stride;
    return (static_cast<int>(from) + stride - 1) / stride * stride;
  };
  return {whole.firstX + next(tile.left), whole.firstY + next(tile.top), whole.firstX + static_cast<int>(tile.right),
          whole.firstY + static_cast<int>(tile.bottom), whole.stride};
}

// Of the pixels of latticeBeside(), from its first on; none that lie within the photo.
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

// [tiles]: where the surround is looked at through each, the stay that has most of the blocks before it.
std::vector<uint32_t> staysBeside(const Capture& capture, int photo, const VolumeModel& model, const BakeStays& stays) {
  const Pose& pose = capture.photos[photo].worldFromCamera;
  const Camera& camera = capture.cameras[capture.photos[photo].camera];
  const PixelLattice whole = latticeBeside(camera, 1);
  const Vec3d origin = model.frame().sceneFromWorld(pose.translation);
  std::vector<uint32_t> made;
  for (const PhotoTile& tile : tilesBeside(camera, photo)) {
    const Vec2d middle(whole.firstX + (tile.left + tile.right) / 2.0, whole.firstY + (tile.top + tile.bottom) / 2.0);
    const auto direction = directionOf(middle, camera, pose, model.frame());
    std::vector<uint32_t> blocks;
    if (direction) blocks = cellsAlong(model.space(), origin, *direction, std::numeric_limits<double>::infinity());
    made.push_back(stays.bestFor(blocks));
  }
  return made;
}

class StayByStay {
 public:
  StayByStay(VolumeModel& model, const Capture& capture, const BakeOptions& options)
      : model_(model),
        capture_(capture),
        options_(options),
        surround_(model.space().blocks() > model.space().cells()),
        tiled_(tilePhotos(capture, model.frame(), model.space())),
        stays_(tiled_, model.space().cells(), model.slots() - (surround_ ? 1 : 0)) {
    for (const int photo : capture.photosIn(Split::train)) {
      photos_.push_back(photo);
      if (surround_) beside_.push_back(staysBeside(capture, photo, model, stays_));
    }
    for (const uint32_t set : tiled_.setOfTile) looks_ += static_cast<int64_t>(stays_.staysOfSet(set).size());
  }
  double inParts() const { return stays_.inParts(); }
  void look(PhotoVisitor& photos) {
    for (uint32_t stay = 0; stay < stays_.stays().size(); ++stay) {
      model_.bring(stays_.stays()[stay]);
      lookDuring(stay, photos);
    }
  }

 private:
  void lookDuring(uint32_t stay, PhotoVisitor& photos) {
    size_t tile = 0;
    for (size_t k = 0; k < photos_.size(); ++k) {
      const Camera& camera = capture_.cameras[capture_.photos[photos_[k]].camera];
      std::vector<PixelLattice> within, beside;
      for (; tile < tiled_.tiles.size() && tiled_.tiles[tile].photo == photos_[k]; ++tile) {
        const std::vector<uint32_t>& in = stays_.staysOfSet(tiled_.setOfTile[tile]);
        if (std::find(in.begin(), in.end(), stay) == in.end()) continue;
        within.push_back(partOf(latticeWithin(camera, options_.stride), tiled_.tiles[tile]));
      }
      if (surround_) {
        const std::vector<PhotoTile> tiles = tilesBeside(camera, photos_[k]);
        for (size_t i = 0; i < tiles.size(); ++i) {
          if (beside_[k][i] == stay) beside.push_back(partOf(latticeBeside(camera, options_.stride), tiles[i]));
        }
      }
      if (within.empty() && beside.empty()) continue;
      photos.begin(photos_[k]);
      photos.look(within, SeenThrough::photo, false);
      photos.look(beside, SeenThrough::margin, true);
      looked_ += static_cast<int64_t>(within.size());
      const int64_t all = static_cast<int64_t>(photos_.size());
      options_.onPhoto(all * looked_ / looks_, all);
    }
  }

  VolumeModel& model_;
  const Capture& capture_;
  const BakeOptions& options_;
  bool surround_;
  TiledPhotos tiled_;
  BakeStays stays_;
  std::vector<int> photos_;                    // that are trained on
  std::vector<std::vector<uint32_t>> beside_;  // [photos_][tiles beside]: the stay
  int64_t looks_ = 0, looked_ = 0;             // through tiles
};

}  // namespace

std::vector<AliveTexels> findAliveTexels(VolumeModel& model, const Capture& capture, const BakeOptions& options) {
  std::vector<AliveTexels> alive(model.space().blocks(), AliveTexels(model.virtualGrid()));
  AliveFinder finder(model, options, alive);
  PhotoVisitor photos(capture, model.frame(), kRays, finder);
  if (model.holdsAll()) {
    const bool surround = model.space().blocks() > model.space().cells();
    photos.visitAll(options.stride, {surround, false}, options.onPhoto);
    return alive;
  }
  StayByStay stays(model, capture, options);
  if (model.config().level == 0 && stays.inParts() >= kWorthSaying) {
    warn(
        "{:.0f} % of what the photos show is seen through blocks that are not in memory together, and looked at in "
        "parts: the scene keeps some of what is hidden there; raise --resident-blocks",
        100 * stays.inParts());
  }
  stays.look(photos);
  return alive;
}

}  // namespace tessera
