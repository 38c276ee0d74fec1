#include "representations/mesh/train/final_stage.h"

#include <algorithm>
#include <cmath>

#include "base/log.h"
#include "base/random.h"
#include "representations/mesh/train/extraction.h"
#include "representations/mesh/train/level_fit.h"

namespace tessera {
namespace {

constexpr uint32_t kCapacityOfHits = 2;  // relative to those that a step needs on average
// Of the texels of coarser levels, at the beginning; and what remains of it at the end.
constexpr double kTexelRate = 0.1, kFinalTexelFactor = 0.1;

// Returns the stride at which a cell has four rays along an edge, at least 1.
int findPhotoStride(double pixelWidth, const OctahedraDomain& domain) {
  constexpr double kRaysAcrossCell = 4, kMaxStride = 4;
  if (pixelWidth <= 0) return 1;
  const double cell = 1 / domain.grids[0].gridFromScene[0];
  return static_cast<int>(std::clamp(cell / kRaysAcrossCell / pixelWidth, 1.0, kMaxStride));
}

}  // namespace

FinalStage::FinalStage(MeshModel& model, const Capture& capture, std::vector<TileShares> tiles, double pixelWidth)
    : model_(model), device_(model.device()), capture_(capture), tiles_(std::move(tiles)), pixelWidth_(pixelWidth) {
  for (Array<float>* losses : {&losses_, &coarserLosses_}) *losses = device_.array<float>(AtlasStage::kLosses);
  for (Array<uint32_t>* counters : {&counters_, &coarserCounters_})
    *counters = device_.array<uint32_t>(AtlasStage::kCounters);
}

void FinalStage::begin() {
  const MeshConfig& config = model_.config();
  const bool isNew = !model_.atlas();
  if (isNew) extract();
  TexelAtlas texels(model_, 0, model_.atlas()->faces, model_.atlas()->patchEdge);
  if (isNew) model_.setAtlasRanges(texels.findRanges(model_));
  constexpr uint32_t kTexelsPerHit = 4, kLeastHits = 256;
  const uint32_t samples = static_cast<uint32_t>(config.samplesPerStep),
                 maxRays = static_cast<uint32_t>(config.maxRays);
  const uint32_t hits = std::max(kLeastHits, kCapacityOfHits * samples / kTexelsPerHit);
  levels_.push_back(std::make_unique<AtlasStage>(model_, 0, std::move(texels), maxRays, hits));
  for (uint32_t level = 1; config.fitsLevels() && level < model_.levels(); ++level) {
    if (model_.coarseAtlas(level) == nullptr) fitCoarserLevel(level);
    TexelAtlas coarse(model_, level, model_.coarseAtlas(level)->faces, model_.atlas()->patchEdge);
    levels_.push_back(std::make_unique<AtlasStage>(model_, level, std::move(coarse), maxRays, hits));
  }
}

void FinalStage::extract() {
  const MeshConfig& config = model_.config();
  inform("{}: looking for the triangles that photos show", model_.part().name);
  if (model_.levels() == 1)  // short trainings end before coarse levels are trained
    model_.addCoarseLevels(mix64(static_cast<uint64_t>(config.seed)));
  ExtractionSettings extraction;
  if (model_.part().isBackground()) {
    extraction.raysPerCell = 0;
  } else {
    extraction.photoStride = findPhotoStride(pixelWidth_, model_.level(0).domain());
  }
  extraction.droppedShare = config.droppedShare;
  extraction.dilation = config.dilation;
  MeshAtlas atlas;
  atlas.patchEdge = static_cast<uint32_t>(config.patchTexels);
  atlas.faces = extractFaces(model_, 0, capture_, &tiles_, extraction);
  if (atlas.faces.count() == 0) {
    warn("{}: no triangle is opaque enough to be kept, so its place will be empty in a scene; train for more steps",
         model_.part().name);
  }
  atlas.ranges.resize(2 * MeshField::kFeatures);  // begin() finds them
  model_.setAtlas(std::move(atlas));
  updateCoverage("before");
}

void FinalStage::fitCoarserLevel(uint32_t level) {
  constexpr int kRaysAcrossTexels = 2;  // of those that find faces
  constexpr double kDroppedShare = 0.01;
  inform("{}: looking for those of level {}", model_.part().name, level);
  ExtractionSettings extraction;
  extraction.photoStride = std::max(1, findPhotoStride(pixelWidth_, model_.level(level).domain()) / kRaysAcrossTexels);
  extraction.raysPerCell *= kRaysAcrossTexels;
  extraction.droppedShare = kDroppedShare;
  FittedLevel fitted = fitLevel(model_, level, capture_, &tiles_, extraction);
  model_.addCoarseAtlas(std::move(fitted.faces), fitted.texels);
}

void FinalStage::undo() {
  if (!model_.atlas()) return;
  model_.removeAtlas();
  levels_.clear();
}

void FinalStage::addGradients(const PhotoRays& rays, PhotoLoss& photoLoss) {
  levels_[0]->addGradients(rays, rays.count(), photoLoss, losses_.all(), counters_.all());
}

void FinalStage::trainCoarserLevels(const PhotoRays& rays, PhotoLoss& photoLoss, double done) {
  for (uint32_t level = 1; level < levels_.size(); ++level) {
    const uint32_t some = std::max(1u, rays.count() >> (level - 1));
    levels_[level]->addGradients(rays, some, photoLoss, coarserLosses_.all(), coarserCounters_.all());
    Adam adam;
    adam.rate = static_cast<float>(kTexelRate * std::pow(kFinalTexelFactor, done));
    adam.skipZeroGradients = true;
    model_.coarseAtlas(level)->texels.step(device_, adam);
  }
}

StepReport FinalStage::report(const PhotoRays& rays) {
  const auto [counts, losses] = device_.readAll(counters_.all(), losses_.all());
  StepReport report;
  report.samples = report.marched = counts[0];
  report.rays = counts[1];
  report.texels = counts[2];
  report.loss = losses[0] + losses[PhotoLoss::kLosses];
  double weight = 0;
  for (uint32_t ray = 0; ray < report.rays; ++ray) weight += rays.batch().weights[ray];
  report.squaredError = losses[1] / std::max(1.0, 3 * weight);
  return report;
}

void FinalStage::updateCoverage(const char* when) {
  if (model_.part().isBackground()) return;
  const SurfaceCoverage coverage = checkCoverage(model_, capture_, tiles_);
  inform("{}: {} triangles; {} the final stage, {} of {} pixels that show a surface in it have a hole", coverage.part,
         model_.atlas()->faces.count(), when, coverage.holes, coverage.pixels);
  model_.setCoverage(coverage);
}

}  // namespace tessera
