#include "representations/field/train/field_trainer.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/log.h"
#include "base/random.h"
#include "compute/composite.h"
#include "compute/losses.h"
#include "train/visible_cells.h"

namespace tessera {
namespace {

constexpr uint32_t kCapacityPerDemand = 2;            // for micro-batches that need more than those of the last step
constexpr uint32_t kCapacityPerRay = 8;               // so that the first round of marching fits
constexpr uint32_t kLosses = PhotoLoss::kLosses + 2;  // of a micro-batch: colour, distortion, depth
constexpr float kMinTransmittance = 1e-4f;

PhotoRays::Settings raySettings(const FieldConfig& config) {
  PhotoRays::Settings settings = config.photoRaySettings();
  settings.randomBackground = config.randomBackground;
  if (config.depthWeight <= 0) settings.sparseDepthRayFraction = 0;
  return settings;
}

}  // namespace

FieldTrainer::FieldTrainer(Device& device, const Capture& capture, const FieldConfig& config, const SceneFrame& frame)
    : device_(device),
      config_(config),
      model_(device, config, frame),
      photoRays_(device, capture, frame, raySettings(config)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.maxRays)),
      budget_(config) {
  const std::vector<bool> visible = visibleCells(capture, frame, model_.space());
  if (std::find(visible.begin(), visible.end(), true) == visible.end()) {
    throw Error(capture.root.string(), "transforms.json", "no training photo sees any of the scene",
                "check the camera poses, the lens model and its distortion");
  }
  model_.occupancy().exclude(visible);
  const uint32_t rays = static_cast<uint32_t>(config.maxRays);
  const uint32_t perMicroBatch = static_cast<uint32_t>(std::min(config.samplesPerStep, config.samplesPerMicroBatch));
  microBatches_ = (static_cast<uint32_t>(config.samplesPerStep) + perMicroBatch - 1) / perMicroBatch;
  const uint32_t raysPerMicroBatch = (rays + microBatches_ - 1) / microBatches_;
  const uint32_t samples =
      std::max({kCapacityPerDemand * perMicroBatch, std::min(kCapacityPerRay * raysPerMicroBatch, 4 * perMicroBatch),
                FieldConfig::kMaxSteps});
  seen_ = RaySamples(device, raysPerMicroBatch, samples);
  counters_ = device.array<uint32_t>(size_t{microBatches_} * RaySamples::kCounters);
  for (Array<float>* perRay : {&opacity_, &depth_}) *perRay = device.array<float>(rays);
  colour_ = device.array<float>(size_t{rays} * 3);
  losses_ = device.array<float>(size_t{microBatches_} * kLosses);
  for (Array<float>* perSample : {&sampleWeights_, &weightGradients_, &logDensityGradients_}) {
    *perSample = device.array<float>(samples);
  }
  sampleColourGradients_ = device.array<float>(size_t{samples} * 3);
}

void FieldTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0) return;
  const uint32_t cells = model_.occupancy().visibleCells();
  const uint64_t seed = mix64(static_cast<uint64_t>(config_.seed) ^ (static_cast<uint64_t>(step) << 20));
  if (step < config_.occupancyWarmupSteps) {
    model_.refreshOccupancy(cells, 0, seed);
  } else {
    const uint32_t share = static_cast<uint32_t>(std::ceil(cells * config_.occupancyUpdateFraction));
    model_.refreshOccupancy(share, share, seed);
  }
}

StepReport FieldTrainer::step(int64_t step, int64_t plannedSteps) {
  refreshOccupancy(step);
  const uint32_t rays = budget_.rays();
  photoRays_.draw(step, rays);
  const auto raysBefore = [&](uint32_t microBatch) {
    return static_cast<uint32_t>(uint64_t{rays} * microBatch / microBatches_);
  };
  for (uint32_t microBatch = 0; microBatch < microBatches_; ++microBatch) {
    addGradients(microBatch, raysBefore(microBatch), raysBefore(microBatch + 1) - raysBefore(microBatch));
  }
  updateParameters(step, plannedSteps);

  // The step is over, so its counters may be read.
  const auto [counters, losses] = device_.readAll(counters_.all(), losses_.all());
  photoLoss_.exposures().settle(step, config_.exposure);
  StepReport report;
  double squares = 0, weight = 0;
  for (uint32_t microBatch = 0; microBatch < microBatches_; ++microBatch) {
    const std::span<const uint32_t> microBatchCounters(&counters[size_t{microBatch} * RaySamples::kCounters],
                                                       RaySamples::kCounters);
    const RoundCounts counts(microBatchCounters, RaySamples::kRounds);
    report.samples += counts.visibleSamples;
    report.rays += counts.finished;
    report.marched += counts.marched;
    const float* loss = &losses[size_t{microBatch} * kLosses];
    report.loss += loss[0] + loss[2] + loss[3];
    squares += loss[1];
    for (uint32_t ray = 0; ray < counts.finished; ++ray)
      weight += photoRays_.batch().weights[raysBefore(microBatch) + ray];
  }
  report.squaredError = squares / std::max(1.0, 3 * weight);

  const double perRay = std::max(1.0, static_cast<double>(report.samples)) / std::max(1u, report.rays);
  double targetRays = config_.samplesPerStep / perRay;
  if (report.rays < rays) targetRays = std::min<double>(targetRays, report.rays);  // not all rays fitted
  budget_.aimFor(std::ceil(targetRays / 8) * 8);
  return report;
}

void FieldTrainer::addGradients(uint32_t microBatch, uint32_t firstRay, uint32_t rayCount) {
  const auto rayRows = [&](auto& array, uint32_t columns) {
    return array.part(size_t{firstRay} * columns, size_t{rayCount} * columns);
  };
  const Slice<const float> directions = photoRays_.directions(firstRay, rayCount);
  const Slice<float> losses = losses_.part(size_t{microBatch} * kLosses, kLosses);
  seen_.counters = counters_.part(size_t{microBatch} * RaySamples::kCounters, RaySamples::kCounters);
  model_.sample(
      {rayCount, photoRays_.origins(firstRay, rayCount), directions, photoRays_.jitter(firstRay, rayCount), {}},
      kMinTransmittance, seen_);
  const Count samples = seen_.samples(), rays = seen_.finished(rayCount);
  RadianceField& field = model_.field();
  const RadianceField::Output output = field.forward(samples, seen_.positions, directions, seen_.rayOfSample, true);

  CompositeForward composite;
  composite.minTransmittance = kMinTransmittance;
  composite.rays = rays;
  composite.firstSample = seen_.firstSample;
  composite.x = output.logDensity;
  composite.steps = seen_.steps;
  composite.distances = seen_.distances;
  composite.colours = output.colours;
  composite.colour = rayRows(colour_, 3);
  composite.opacity = rayRows(opacity_, 1);
  composite.depth = rayRows(depth_, 1);
  composite.weights = sampleWeights_;
  device_.run(composite);
  const PhotoLoss::Picture picture{rays, firstRay, rayCount, composite.colour, composite.opacity};
  photoLoss_.compare(photoRays_, picture, losses.part(0, PhotoLoss::kLosses));
  photoLoss_.passBack(photoRays_, picture);

  const float allRays = static_cast<float>(photoRays_.count());
  DistortionLoss distortion;
  distortion.scale = static_cast<float>(config_.distortionWeight) / allRays;
  distortion.rays = rays;
  distortion.firstSample = seen_.firstSample;
  distortion.weights = sampleWeights_;
  distortion.distances = seen_.distances;
  distortion.steps = seen_.steps;
  distortion.loss = losses.part(2, 1);
  distortion.weightGradients = weightGradients_;
  device_.run(distortion);
  if (config_.depthWeight > 0 && config_.sparseDepthRayFraction > 0) {
    DepthLoss depth;
    depth.scale = static_cast<float>(config_.depthWeight) / allRays;
    depth.tolerance = static_cast<float>(config_.depthTolerance);
    depth.rays = rays;
    depth.firstSample = seen_.firstSample;
    depth.weights = sampleWeights_;
    depth.distances = seen_.distances;
    depth.known = photoRays_.distances(firstRay, rayCount);
    depth.loss = losses.part(3, 1);
    depth.weightGradients = weightGradients_;
    device_.run(depth);
  }

  CompositeBackward back;
  back.minTransmittance = kMinTransmittance;
  back.fullGradientDistance = static_cast<float>(config_.fullGradientDistance);
  back.rays = rays;
  back.firstSample = seen_.firstSample;
  back.x = output.logDensity;
  back.steps = seen_.steps;
  back.distances = seen_.distances;
  back.colours = output.colours;
  back.rayColourGradients = photoLoss_.colourGradients(picture);
  back.rayOpacityGradients = photoLoss_.opacityGradients(picture);
  back.weightGradients = weightGradients_;
  back.xGradients = logDensityGradients_;
  back.colourGradients = Matrix<float>(sampleColourGradients_, 3);
  device_.run(back);
  field.backward(samples, seen_.positions, logDensityGradients_, Matrix<const float>(sampleColourGradients_, 3));
}

void FieldTrainer::updateParameters(int64_t step, int64_t plannedSteps) {
  Adam adam;
  adam.rate = static_cast<float>(config_.rateSchedule().at(step, plannedSteps));
  adam.skipZeroGradients = true;
  adam.l2 = static_cast<float>(config_.tableL2);
  model_.field().table().step(device_, adam);
  adam.skipZeroGradients = false;
  adam.l2 = static_cast<float>(config_.networkL2);
  model_.field().densityNetwork().step(device_, adam);
  model_.field().colourNetwork().step(device_, adam);
  Adam exposureAdam;
  exposureAdam.rate = static_cast<float>(config_.exposureLearningRate * adam.rate / config_.learningRate);
  exposureAdam.skipZeroGradients = true;
  photoLoss_.exposures().step(exposureAdam, config_.exposure);
}

Bytes FieldTrainer::save(uint32_t) {
  TensorSet tensors;
  model_.save(tensors, true);
  photoLoss_.exposures().save(tensors);
  budget_.save(tensors);
  return tensors.encode({{"format", "tessera field 1"}, {"device", device_.target()}});
}

std::optional<uint32_t> FieldTrainer::firstNonFinitePart() {
  return model_.allFinite() && photoLoss_.exposures().allFinite() ? std::nullopt : std::optional<uint32_t>(0);
}

void FieldTrainer::restore(uint32_t, const fs::path& path, const Safetensors& state) {
  requireFormat(path, state, "tessera field 1", "field");
  warnOfOtherDevice(path, state, device_.target());
  model_.restore(path, state);
  photoLoss_.exposures().restore(path, state);
  budget_.restore(path, state);
}

}  // namespace tessera
