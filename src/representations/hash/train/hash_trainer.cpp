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

constexpr double kCapacityPerDemand = 2;  // for steps that need more than the last one did
constexpr float kTrainingMinTransmittance = 1e-4f;
constexpr const char* kFormat = "tessera hash 1";

PhotoRays::Settings raySettings(const HashConfig& config) {
  PhotoRays::Settings settings = config.photoRaySettings();
  settings.randomBackground = config.background == "random";
  if (config.depthWeight <= 0) settings.sparseDepthRayFraction = 0;
  return settings;
}

HashPipeline::Capacity makeCapacity(const HashConfig& config) {
  HashPipeline::Capacity capacity;
  capacity.rays = static_cast<uint32_t>(config.maxRays);
  capacity.samples = std::max(static_cast<uint32_t>(kCapacityPerDemand * config.samplesPerStep), HashModel::kMaxSteps);
  capacity.texels = static_cast<uint32_t>(kCapacityPerDemand * config.texelsPerStep);
  capacity.training = true;
  return capacity;
}

}  // namespace

double distortionWeight(const HashConfig& config, int64_t step, int64_t plannedSteps) {
  // While the number of steps is not known, training is assumed to be at its beginning.
  const double risen = config.lossWarmupFraction * static_cast<double>(plannedSteps);
  const double share = risen > 0                       ? std::min(1.0, static_cast<double>(step) / risen)
                       : config.lossWarmupFraction > 0 ? 0
                                                       : 1;
  return config.distortionWeight.value() * share;
}

HashTrainer::HashTrainer(Device& device, const Capture& capture, const HashConfig& config, const BlockGrid& grid)
    : device_(device),
      config_(config),
      model_(device, config, grid),
      pipeline_(model_, makeCapacity(config)),
      photoRays_(device, capture, model_.frame(), raySettings(config)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.maxRays)),
      budget_(config) {
  CHECK(config.distortionWeight.has_value());
  bool anything = false;
  for (uint32_t block = 0; block < parts(); ++block) {
    const std::vector<bool> visible = visibleCells(capture, model_.frame(), model_.occupancySpace(block),
                                                   makeBlockDomain(model_.space().placement(block)));
    anything = anything || std::find(visible.begin(), visible.end(), true) != visible.end();
    model_.exclude(block, visible);
  }
  if (!anything) {
    throw Error(capture.root.string(), "transforms.json", "no training photo sees any of the scene",
                "check the camera poses, the lens model and its distortion");
  }
  losses_ = device.array<float>(PhotoLoss::kLosses);
}

void HashTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0) return;
  model_.refreshOccupancy(step < config_.occupancyWarmupSteps,
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
  pipeline_.forward(rays, kTrainingMinTransmittance);
  return rays;
}

// If the lattice corners exceed the capacity, the step is invalid and is repeated with fewer rays.
bool HashTrainer::drawsFewerRays(uint32_t texelsDemanded) {
  return budget_.drawsFewer(texelsDemanded, model_.fields().texelCapacity());
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
    // The step is over, so its counters may be read. If it exceeded the capacity, it has not changed any parameter.
    std::tie(counters, losses, inner) = device_.readAll(pipeline_.counters(), losses_.all(), pipeline_.losses());
    report.texels = *std::max_element(counters.begin() + HashSamples::kFirstTexels, counters.end());
  } while (drawsFewerRays(report.texels));
  photoLoss_.exposures().settle(step, config_.exposure);

  const RoundCounts counts(counters, HashSamples::kRounds);
  report.samples = counts.visibleSamples;
  report.rays = counts.finished;
  report.marched = counts.marched;
  const Evaluation evaluation = makeEvaluation(report.rays, losses);
  report.loss = evaluation.loss + inner[0] + inner[1];
  report.squaredError = evaluation.squaredError / std::max(1.0, evaluation.channels);
  const double perRay = static_cast<double>(report.samples) / std::max(1u, report.rays);
  model_.adaptStep(perRay);

  double targetRays = config_.samplesPerStep / std::max(1.0 / 64, perRay);
  const uint32_t rays = budget_.rays();
  targetRays = std::min(targetRays, rays * static_cast<double>(config_.texelsPerStep) / std::max(1u, report.texels));
  if (report.rays < rays) targetRays = std::min<double>(targetRays, report.rays);  // not all rays fitted
  budget_.aimFor(std::ceil(targetRays / 8) * 8);
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

void HashTrainer::evaluateOn(std::vector<TileShares> photos) {
  photoLoss_.exposures().centre();
  photoRays_.drawFrom(std::move(photos));
}

HashTrainer::Evaluation HashTrainer::evaluate(int64_t step) {
  std::vector<uint32_t> counters;
  std::vector<float> losses;
  do {
    photoLoss_.compare(photoRays_, makeLossPicture(drawRays(step)), losses_);
    std::tie(counters, losses) = device_.readAll(pipeline_.counters(), losses_.all());
  } while (drawsFewerRays(*std::max_element(counters.begin() + HashSamples::kFirstTexels, counters.end())));
  return makeEvaluation(counters[MarchRounds::kFinished], losses);
}

HashTrainer::Evaluation HashTrainer::makeEvaluation(uint32_t rays, const std::vector<float>& losses) const {
  double weight = 0;
  for (uint32_t ray = 0; ray < rays; ++ray) weight += photoRays_.batch().weights[ray];
  return {losses[1], 3 * weight, losses[0]};
}

PhotoLoss::Picture HashTrainer::makeLossPicture(const HashModel::Rays& rays) const {
  return {pipeline_.finished(rays),      0, rays.count, pipeline_.colour(), pipeline_.opacity(),
          config_.background == "random"};
}

void HashTrainer::addGradients(const HashModel::Rays& drawn, int64_t step, int64_t plannedSteps) {
  const PhotoLoss::Picture picture = makeLossPicture(drawn);
  photoLoss_.compare(photoRays_, picture, losses_);
  photoLoss_.passBack(photoRays_, picture);
  HashPipeline::LossScales scales;
  scales.distortion = static_cast<float>(distortionWeight(config_, step, plannedSteps) / drawn.count);
  if (config_.sparseDepthRayFraction > 0) scales.depth = static_cast<float>(config_.depthWeight / drawn.count);
  scales.depthTolerance = static_cast<float>(config_.depthTolerance);
  pipeline_.backward(drawn, photoLoss_.colourGradients(picture), photoLoss_.opacityGradients(picture),
                     photoRays_.distances(0, drawn.count), scales);
}

void HashTrainer::updateParameters(int64_t step, int64_t plannedSteps) {
  RateSchedule schedule = config_.rateSchedule();
  schedule.warmUpSteps = config_.warmupSteps;
  schedule.linear = config_.learningRateSchedule == "linear";
  HashFields::Rates rates;
  rates.table.rate = rates.network.rate = static_cast<float>(schedule.at(step, plannedSteps));
  rates.table.skipZeroGradients = rates.network.skipZeroGradients = true;
  rates.fine = rates.table;
  rates.fine.rate *= static_cast<float>(config_.fineLearningRateFactor);
  rates.network.l2 = static_cast<float>(config_.networkL2);
  for (Adam* adam : {&rates.table, &rates.fine, &rates.network}) {
    if (budget_.canShrink()) adam->overflowCounters = pipeline_.texelsDemanded();
    adam->capacity = model_.fields().texelCapacity();
  }
  model_.fields().step(rates);
  model_.direction().step(device_, rates.network);
  Adam exposureAdam = rates.table;
  exposureAdam.rate = static_cast<float>(config_.exposureLearningRate * rates.table.rate / config_.learningRate);
  photoLoss_.exposures().step(exposureAdam, config_.exposure);
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

std::optional<uint32_t> HashTrainer::firstNonFinitePart() {
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
