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

constexpr uint32_t kRoomPerWanted = 2;                // for passes that see more than the last step's did
constexpr uint32_t kRoomPerRay = 8;                   // so that the first round of marching fits
constexpr uint32_t kLosses = PhotoLoss::kLosses + 2;  // of a pass: of colours, distortion, depth
constexpr float kMinTransmittance = 1e-4f;

PhotoRays::Settings raySettings(const FieldConfig& config) {
  PhotoRays::Settings settings = config.photoRaySettings();
  settings.randomBackground = config.randomBackground;
  if (config.depth <= 0) settings.knownShare = 0;
  return settings;
}

}  // namespace

FieldTrainer::FieldTrainer(Device& device, const Capture& capture, const FieldConfig& config, const SceneFrame& frame)
    : device_(device),
      config_(config),
      model_(device, config, frame),
      photoRays_(device, capture, frame, raySettings(config)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.mostRays)),
      budget_(config) {
  const std::vector<bool> visible = visibleCells(capture, frame, model_.space());
  if (std::find(visible.begin(), visible.end(), true) == visible.end()) {
    throw Error(capture.root.string(), "transforms.json", "no training photo sees any of the scene",
                "look whether the poses are right, and the lens and its distortion");
  }
  model_.occupancy().exclude(visible);
  const uint32_t rays = static_cast<uint32_t>(config.mostRays);
  const uint32_t perPass = static_cast<uint32_t>(std::min(config.samplesPerStep, config.samplesPerPass));
  passes_ = (static_cast<uint32_t>(config.samplesPerStep) + perPass - 1) / perPass;
  const uint32_t raysPerPass = (rays + passes_ - 1) / passes_;
  const uint32_t samples =
      std::max({kRoomPerWanted * perPass, std::min(kRoomPerRay * raysPerPass, 4 * perPass), FieldConfig::kMostSteps});
  seen_ = RaySamples(device, raysPerPass, samples);
  counters_ = device.array<uint32_t>(size_t{passes_} * RaySamples::kCounters);
  for (Array<float>* perRay : {&opacity_, &depth_}) *perRay = device.array<float>(rays);
  colour_ = device.array<float>(size_t{rays} * 3);
  losses_ = device.array<float>(size_t{passes_} * kLosses);
  for (Array<float>* perSample : {&sampleWeights_, &weightGradients_, &logDensityGradients_}) {
    *perSample = device.array<float>(samples);
  }
  sampleColourGradients_ = device.array<float>(size_t{samples} * 3);
}

void FieldTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0) return;
  const uint32_t cells = model_.occupancy().visibleCells();
  const uint64_t seed = mix64(static_cast<uint64_t>(config_.seed) ^ (static_cast<uint64_t>(step) << 20));
  if (step < config_.occupancyWarmUp) {
    model_.refreshOccupancy(cells, 0, seed);
  } else {
    const uint32_t share = static_cast<uint32_t>(std::ceil(cells * config_.occupancyShare));
    model_.refreshOccupancy(share, share, seed);
  }
}

StepReport FieldTrainer::step(int64_t step, int64_t plannedSteps) {
  refreshOccupancy(step);
  const uint32_t rays = budget_.rays();
  photoRays_.draw(step, rays);
  const auto raysBefore = [&](uint32_t pass) { return static_cast<uint32_t>(uint64_t{rays} * pass / passes_); };
  for (uint32_t pass = 0; pass < passes_; ++pass) {
    addGradients(pass, raysBefore(pass), raysBefore(pass + 1) - raysBefore(pass));
  }
  updateParameters(step, plannedSteps);

  // The step is over: its counters may be read.
  const auto [counters, losses] = device_.readTogether(counters_.all(), losses_.all());
  photoLoss_.exposures().settle(step, config_.exposure);
  StepReport report;
  double squares = 0, weight = 0;
  for (uint32_t pass = 0; pass < passes_; ++pass) {
    const std::span<const uint32_t> ofPass(&counters[size_t{pass} * RaySamples::kCounters], RaySamples::kCounters);
    const RoundCounts counts(ofPass, RaySamples::kRounds);
    report.samples += counts.kept;
    report.rays += counts.finished;
    report.marched += counts.marched;
    const float* loss = &losses[size_t{pass} * kLosses];
    report.loss += loss[0] + loss[2] + loss[3];
    squares += loss[1];
    for (uint32_t ray = 0; ray < counts.finished; ++ray) weight += photoRays_.batch().weights[raysBefore(pass) + ray];
  }
  report.squaredError = squares / std::max(1.0, 3 * weight);

  const double perRay = std::max(1.0, static_cast<double>(report.samples)) / std::max(1u, report.rays);
  double wanted = config_.samplesPerStep / perRay;
  if (report.rays < rays) wanted = std::min<double>(wanted, report.rays);  // not all of them fitted
  budget_.aimFor(std::ceil(wanted / 8) * 8);
  return report;
}

void FieldTrainer::addGradients(uint32_t pass, uint32_t firstRay, uint32_t rayCount) {
  const auto ofRays = [&](auto& array, uint32_t columns) {
    return array.part(size_t{firstRay} * columns, size_t{rayCount} * columns);
  };
  const Slice<const float> directions = photoRays_.directions(firstRay, rayCount);
  const Slice<float> losses = losses_.part(size_t{pass} * kLosses, kLosses);
  seen_.counters = counters_.part(size_t{pass} * RaySamples::kCounters, RaySamples::kCounters);
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
  composite.colour = ofRays(colour_, 3);
  composite.opacity = ofRays(opacity_, 1);
  composite.depth = ofRays(depth_, 1);
  composite.weights = sampleWeights_;
  device_.run(composite);
  const PhotoLoss::Picture picture{rays, firstRay, rayCount, composite.colour, composite.opacity};
  photoLoss_.compare(photoRays_, picture, losses.part(0, PhotoLoss::kLosses));
  photoLoss_.passBack(photoRays_, picture);

  const float allRays = static_cast<float>(photoRays_.count());
  DistortionLoss distortion;
  distortion.scale = static_cast<float>(config_.distortion) / allRays;
  distortion.rays = rays;
  distortion.firstSample = seen_.firstSample;
  distortion.weights = sampleWeights_;
  distortion.distances = seen_.distances;
  distortion.steps = seen_.steps;
  distortion.loss = losses.part(2, 1);
  distortion.weightGradients = weightGradients_;
  device_.run(distortion);
  if (config_.depth > 0 && config_.knownShare > 0) {
    DepthLoss depth;
    depth.scale = static_cast<float>(config_.depth) / allRays;
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
  Adam ofExposures;
  ofExposures.rate = static_cast<float>(config_.exposureRate * adam.rate / config_.rate);
  ofExposures.skipZeroGradients = true;
  photoLoss_.exposures().step(ofExposures, config_.exposure);
}

Bytes FieldTrainer::save(uint32_t) {
  TensorSet tensors;
  model_.save(tensors, true);
  photoLoss_.exposures().save(tensors);
  budget_.save(tensors);
  return tensors.encode({{"format", "tessera field 1"}, {"device", device_.target()}});
}

std::optional<uint32_t> FieldTrainer::brokenPart() {
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
