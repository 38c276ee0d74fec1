#include "representations/hash/train/hash_trainer.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "base/error.h"
#include "base/random.h"
#include "compute/block_path.h"
#include "train/visible_cells.h"

namespace tessera {
namespace {

constexpr double kRoomPerWanted = 2;  // for steps that see more than the last one did
constexpr float kTrainingMinTransmittance = 1e-4f;
constexpr const char* kFormat = "tessera hash 1";

PhotoRays::Settings raySettings(const HashConfig& config) {
  PhotoRays::Settings settings = config.photoRaySettings();
  settings.randomBackground = config.background == "random";
  if (config.depth <= 0) settings.knownShare = 0;
  return settings;
}

HashPass::Room roomFor(const HashConfig& config) {
  HashPass::Room room;
  room.rays = static_cast<uint32_t>(config.mostRays);
  room.samples = std::max(static_cast<uint32_t>(kRoomPerWanted * config.samplesPerStep), HashModel::kMostSteps);
  room.texels = static_cast<uint32_t>(kRoomPerWanted * config.texelsPerStep);
  room.training = true;
  return room;
}

}  // namespace

double distortionWeight(const HashConfig& config, int64_t step, int64_t plannedSteps) {
  // While the number of steps is not known, it is early.
  const double risen = config.rampShare * static_cast<double>(plannedSteps);
  const double share = risen > 0 ? std::min(1.0, static_cast<double>(step) / risen) : config.rampShare > 0 ? 0 : 1;
  return config.distortion.value() * share;
}

HashTrainer::HashTrainer(Device& device, const Capture& capture, const HashConfig& config, const BlockGrid& grid)
    : device_(device),
      config_(config),
      model_(device, config, grid),
      pass_(model_, roomFor(config)),
      photoRays_(device, capture, model_.frame(), raySettings(config)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.mostRays)),
      budget_(config) {
  CHECK(config.distortion.has_value());
  bool anything = false;
  for (uint32_t block = 0; block < parts(); ++block) {
    const std::vector<bool> visible =
        visibleCells(capture, model_.frame(), model_.occupancySpace(block), domainOf(model_.space().placement(block)));
    anything = anything || std::find(visible.begin(), visible.end(), true) != visible.end();
    model_.exclude(block, visible);
  }
  if (!anything) {
    throw Error(capture.root.string(), "transforms.json", "no training photo sees any of the scene",
                "look whether the poses are right, and the lens and its distortion");
  }
  losses_ = device.array<float>(PhotoLoss::kLosses);
}

void HashTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0) return;
  model_.refreshOccupancy(step < config_.occupancyWarmUp,
                          mix64(static_cast<uint64_t>(config_.seed) ^ (static_cast<uint64_t>(step) << 20)));
}

HashModel::Rays HashTrainer::drawRays(int64_t step) {
  const uint32_t count = budget_.rays();
  photoRays_.draw(step, count);
  const HashModel::Rays rays{count,
                             photoRays_.origins(0, count),
                             photoRays_.directions(0, count),
                             photoRays_.jitter(0, count),
                             photoRays_.nears(0, count),
                             photoRays_.fars(0, count)};
  pass_.forward(rays, kTrainingMinTransmittance);
  return rays;
}

// Where corners have no room, what they hold counts as nothing: then again with fewer rays.
bool HashTrainer::drawsFewerRays(uint32_t texelsWanted) {
  return budget_.drawsFewer(texelsWanted, model_.fields().roomForTexels());
}

StepReport HashTrainer::step(int64_t step, int64_t plannedSteps) {
  refreshOccupancy(step);
  std::vector<uint32_t> counters;
  std::vector<float> losses, inner;
  StepReport report;
  do {
    const HashModel::Rays rays = drawRays(step);
    addGradients(rays, step, plannedSteps);
    updateParameters(step, plannedSteps);
    // The step is over: its counters may be read. Where it had no room, it has changed nothing.
    std::tie(counters, losses, inner) = device_.readTogether(pass_.counters(), losses_.all(), pass_.losses());
    report.texels = *std::max_element(counters.begin() + HashSamples::kFirstTexels, counters.end());
  } while (drawsFewerRays(report.texels));
  photoLoss_.exposures().settle(step, config_.exposure);

  const RoundCounts counts(counters, HashSamples::kRounds);
  report.samples = counts.kept;
  report.rays = counts.finished;
  report.marched = counts.marched;
  const Fit fit = fitOf(report.rays, losses);
  report.loss = fit.loss + inner[0] + inner[1];
  report.squaredError = fit.squaredError / std::max(1.0, fit.channels);
  const double perRay = static_cast<double>(report.samples) / std::max(1u, report.rays);
  model_.adaptStep(perRay);

  double wanted = config_.samplesPerStep / std::max(1.0 / 64, perRay);
  const uint32_t rays = budget_.rays();
  wanted = std::min(wanted, rays * static_cast<double>(config_.texelsPerStep) / std::max(1u, report.texels));
  if (report.rays < rays) wanted = std::min<double>(wanted, report.rays);  // not all of them fitted
  budget_.aimFor(std::ceil(wanted / 8) * 8);
  return report;
}

void HashTrainer::trainOn(std::vector<TileShares> photos) {
  std::vector<int> trained;
  for (size_t photo = 0; photo < photos.size(); ++photo) {
    if (photos[photo].total() > 0) trained.push_back(static_cast<int>(photo));
  }
  photoLoss_.exposures().trainOn(std::move(trained));
  photoRays_.drawFrom(std::move(photos));
}

void HashTrainer::judgeBy(std::vector<TileShares> photos) {
  photoLoss_.exposures().centre();
  photoRays_.drawFrom(std::move(photos));
}

HashTrainer::Fit HashTrainer::fit(int64_t step) {
  std::vector<uint32_t> counters;
  std::vector<float> losses;
  do {
    photoLoss_.compare(photoRays_, pictureOf(drawRays(step)), losses_);
    std::tie(counters, losses) = device_.readTogether(pass_.counters(), losses_.all());
  } while (drawsFewerRays(*std::max_element(counters.begin() + HashSamples::kFirstTexels, counters.end())));
  return fitOf(counters[MarchRounds::kFinished], losses);
}

HashTrainer::Fit HashTrainer::fitOf(uint32_t rays, const std::vector<float>& losses) const {
  double weight = 0;
  for (uint32_t ray = 0; ray < rays; ++ray) weight += photoRays_.batch().weights[ray];
  return {losses[1], 3 * weight, losses[0]};
}

PhotoLoss::Picture HashTrainer::pictureOf(const HashModel::Rays& rays) const {
  return {pass_.finished(rays), 0, rays.count, pass_.colour(), pass_.opacity(), config_.background == "random"};
}

void HashTrainer::addGradients(const HashModel::Rays& drawn, int64_t step, int64_t plannedSteps) {
  const PhotoLoss::Picture picture = pictureOf(drawn);
  photoLoss_.compare(photoRays_, picture, losses_);
  photoLoss_.passBack(photoRays_, picture);
  HashPass::LossScales scales;
  scales.distortion = static_cast<float>(distortionWeight(config_, step, plannedSteps) / drawn.count);
  if (config_.knownShare > 0) scales.depth = static_cast<float>(config_.depth / drawn.count);
  scales.depthTolerance = static_cast<float>(config_.depthTolerance);
  pass_.backward(drawn, photoLoss_.colourGradients(picture), photoLoss_.opacityGradients(picture),
                 photoRays_.distances(0, drawn.count), scales);
}

void HashTrainer::updateParameters(int64_t step, int64_t plannedSteps) {
  RateSchedule schedule = config_.rateSchedule();
  schedule.warmUpSteps = config_.warmUpSteps;
  schedule.linear = config_.rateFall == "linear";
  HashFields::Rates rates;
  rates.table.rate = rates.network.rate = static_cast<float>(schedule.at(step, plannedSteps));
  rates.table.skipZeroGradients = rates.network.skipZeroGradients = true;
  rates.fine = rates.table;
  rates.fine.rate *= static_cast<float>(config_.fineRateFactor);
  rates.network.l2 = static_cast<float>(config_.networkL2);
  for (Adam* adam : {&rates.table, &rates.fine, &rates.network}) {
    if (budget_.canShrink()) adam->found = pass_.texelsWanted();
    adam->room = model_.fields().roomForTexels();
  }
  model_.fields().step(rates);
  model_.direction().step(device_, rates.network);
  Adam ofExposures = rates.table;
  ofExposures.rate = static_cast<float>(config_.exposureRate * rates.table.rate / config_.rate);
  photoLoss_.exposures().step(ofExposures, config_.exposure);
}

Bytes HashTrainer::save(uint32_t part) {
  TensorSet tensors;
  model_.save(part, tensors, true);
  if (part == 0) {
    photoLoss_.exposures().save(tensors);
    budget_.save(tensors);
  }
  return tensors.encode({{"format", kFormat}, {"device", device_.target()}, {"block", std::to_string(part)}});
}

std::optional<uint32_t> HashTrainer::brokenPart() {
  for (uint32_t part = 0; part < parts(); ++part) {
    if (!model_.allFinite(part)) return part;
  }
  return photoLoss_.exposures().allFinite() ? std::nullopt : std::optional<uint32_t>(0);
}

void HashTrainer::restore(uint32_t part, const fs::path& path, const Safetensors& state) {
  requireFormat(path, state, kFormat, "hash");
  model_.restore(part, path, state);
  if (part != 0) return;
  warnOfOtherDevice(path, state, device_.target());
  photoLoss_.exposures().restore(path, state);
  budget_.restore(path, state);
}

}  // namespace tessera
