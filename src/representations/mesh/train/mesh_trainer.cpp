#include "representations/mesh/train/mesh_trainer.h"

#include <algorithm>
#include <cmath>

#include "compute/composite.h"
#include "representations/mesh/train/mesh_schedule.h"

namespace tessera {
namespace {

constexpr uint32_t kCapacityPerDemand = 2;                // for steps that need more than the last one
constexpr uint32_t kMaxTrainingHits = 256;                // of a ray
constexpr uint32_t kLosses = 2 * PhotoLoss::kLosses + 1;  // of both images, and distortion
constexpr float kMinTrainingTransmittance = 1e-4f;
constexpr double kFinalVertexFactor = 0.01;

PhotoRays::Settings raySettings(const MeshConfig& config) {
  PhotoRays::Settings settings = config.photoRaySettings();
  settings.randomBackground = config.randomBackground;
  settings.sparseDepthRayFraction = 0;
  return settings;
}

}  // namespace

MeshTrainer::MeshTrainer(Device& device, const Capture& capture, const MeshConfig& config, const SceneFrame& frame,
                         MeshStart start)
    : device_(device),
      config_(config),
      model_(device, config, frame),
      photoRays_(device, capture, frame, raySettings(config)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.maxRays)),
      budget_(config) {
  model_.exclude(start.cells);
  photoRays_.drawFrom(std::move(start.tiles));
  const uint32_t rays = static_cast<uint32_t>(config.maxRays);
  const uint32_t samples = kCapacityPerDemand * static_cast<uint32_t>(config.samplesPerStep);
  hits_ = MeshHits(device, rays, samples);
  counters_ = device.array<uint32_t>(MeshHits::kCounters);
  hits_.counters = counters_;
  model_.field().reserve(samples);
  for (Array<float>* perRay : {&opacity_, &opaqueOpacity_}) *perRay = device.array<float>(rays);
  for (Array<float>* perRay : {&colour_, &opaqueColour_}) *perRay = device.array<float>(size_t{rays} * 3);
  losses_ = device.array<float>(kLosses);
  for (Array<float>* perSample : {&sampleWeights_, &sampleSteps_, &weightGradients_, &logitGradients_})
    *perSample = device.array<float>(samples);
  for (Array<float>* perSample : {&sampleColourGradients_, &positionGradients_})
    *perSample = device.array<float>(size_t{samples} * 3);
}

void MeshTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0 || step < config_.occupancyWarmupSteps) return;
  model_.refreshOccupancy();
}

StepReport MeshTrainer::step(int64_t step, int64_t plannedSteps) {
  refreshOccupancy(step);
  const uint32_t rays = budget_.rays();
  photoRays_.draw(step, rays);
  addGradients(step, plannedSteps);
  updateParameters(step, plannedSteps);

  // The step is over, so its counters may be read.
  const auto [counters, losses] = device_.readAll(counters_.all(), losses_.all());
  photoLoss_.exposures().settle(step, config_.exposure);
  StepReport report;
  report.samples = report.marched = std::min<uint32_t>(counters[0], static_cast<uint32_t>(hits_.distances.size()));
  report.rays = counters[1];
  report.loss = losses[0] + losses[PhotoLoss::kLosses] + losses[2 * PhotoLoss::kLosses];
  double weight = 0;
  for (uint32_t ray = 0; ray < report.rays; ++ray) weight += photoRays_.batch().weights[ray];
  report.squaredError = losses[1] / std::max(1.0, 3 * weight);
  const double perRay = std::max(1.0, static_cast<double>(report.samples)) / std::max(1u, report.rays);
  double targetRays = config_.samplesPerStep / perRay;
  if (report.rays < rays) targetRays = std::min<double>(targetRays, report.rays);  // not all rays fitted
  budget_.aimFor(std::ceil(targetRays / 8) * 8);
  return report;
}

void MeshTrainer::addGradients(int64_t step, int64_t plannedSteps) {
  const uint32_t rays = photoRays_.count();
  const Slice<const float> directions = photoRays_.directions(0, rays);
  const MeshModel::Rays traced{rays, photoRays_.origins(0, rays), directions, {}};
  model_.trace(traced, kMaxTrainingHits, hits_);
  const Count samples = hits_.samples(), finished = hits_.finished(rays);
  MeshField& field = model_.field();
  const MeshField::Output output = field.forward(samples, hits_.positions, directions, hits_.rayOfSample, true);
  model_.addOccupancy(traced, hits_, output.logits);
  const double firstWeight = config_.opaqueLoss ? MeshSchedule::firstWeight(step, plannedSteps) : 1;

  CompositeForward composite;
  composite.extinction = Extinction::logit;
  composite.offset = model_.opacityOffset();
  composite.minTransmittance = kMinTrainingTransmittance;
  composite.rays = finished;
  composite.firstSample = hits_.firstSample;
  composite.x = output.logits;
  composite.colours = output.colours;
  composite.colour = colour_;
  composite.opacity = opacity_;
  composite.weights = sampleWeights_;
  device_.run(composite);
  const PhotoLoss::Picture first{finished,
                                 0,
                                 rays,
                                 colour_.part(0, size_t{3} * rays),
                                 opacity_.part(0, rays),
                                 true,
                                 static_cast<float>(firstWeight)};
  photoLoss_.compare(photoRays_, first, losses_.part(0, PhotoLoss::kLosses));
  photoLoss_.passBack(photoRays_, first);
  const Slice<float> distortionLoss = losses_.part(2 * PhotoLoss::kLosses, 1);
  if (config_.distortionWeight > 0) {
    DistortionLoss distortion;
    distortion.scale = static_cast<float>(config_.distortionWeight) / static_cast<float>(rays);
    distortion.rays = finished;
    distortion.firstSample = hits_.firstSample;
    distortion.weights = sampleWeights_;
    distortion.distances = hits_.distances;
    distortion.steps = sampleSteps_;  // zero: hits have no extent along the ray
    distortion.loss = distortionLoss;
    distortion.weightGradients = weightGradients_;
    device_.run(distortion);
  }

  CompositeBackward back;
  back.extinction = composite.extinction;
  back.offset = composite.offset;
  back.minTransmittance = kMinTrainingTransmittance;
  back.rays = finished;
  back.firstSample = hits_.firstSample;
  back.x = output.logits;
  back.colours = output.colours;
  back.rayColourGradients = photoLoss_.colourGradients(first);
  back.rayOpacityGradients = photoLoss_.opacityGradients(first);
  if (config_.distortionWeight > 0) back.weightGradients = weightGradients_;
  back.xGradients = logitGradients_;
  back.colourGradients = Matrix<float>(sampleColourGradients_, 3);
  device_.run(back);

  const Slice<float> opaqueLosses = losses_.part(PhotoLoss::kLosses, PhotoLoss::kLosses);
  if (firstWeight < 1) {
    OpaqueForward opaque;
    opaque.threshold = static_cast<float>(MeshSchedule::threshold(step, plannedSteps));
    opaque.offset = composite.offset;
    opaque.rays = finished;
    opaque.firstSample = hits_.firstSample;
    opaque.x = output.logits;
    opaque.colours = output.colours;
    opaque.colour = opaqueColour_;
    opaque.opacity = opaqueOpacity_;
    device_.run(opaque);
    const PhotoLoss::Picture second{finished,
                                    0,
                                    rays,
                                    opaqueColour_.part(0, size_t{3} * rays),
                                    opaqueOpacity_.part(0, rays),
                                    false,
                                    static_cast<float>(1 - firstWeight)};
    photoLoss_.compare(photoRays_, second, opaqueLosses);
    photoLoss_.passBack(photoRays_, second);
    OpaqueBackward opaqueBack;
    opaqueBack.threshold = opaque.threshold;
    opaqueBack.offset = opaque.offset;
    opaqueBack.rays = finished;
    opaqueBack.firstSample = hits_.firstSample;
    opaqueBack.x = output.logits;
    opaqueBack.colours = output.colours;
    opaqueBack.colour = opaqueColour_;
    opaqueBack.rayColourGradients = photoLoss_.colourGradients(second);
    opaqueBack.xGradients = logitGradients_;
    opaqueBack.colourGradients = back.colourGradients;
    device_.run(opaqueBack);
  } else {
    device_.fillZero(opaqueLosses);
  }
  const bool moves = step >= config_.vertexStartSteps && config_.vertexLearningRate > 0;
  field.backward(samples, hits_.positions, logitGradients_, Matrix<const float>(sampleColourGradients_, 3),
                 moves ? positionGradients_.all() : Slice<float>());
  if (moves) model_.backward(traced, hits_, positionGradients_);
}

void MeshTrainer::updateParameters(int64_t step, int64_t plannedSteps) {
  Adam adam;
  adam.rate = static_cast<float>(config_.rateSchedule().at(step, plannedSteps));
  adam.skipZeroGradients = true;
  model_.field().table().step(device_, adam);
  adam.skipZeroGradients = false;
  adam.l2 = static_cast<float>(config_.networkL2);
  model_.field().encoder().step(device_, adam);
  model_.field().decoder().step(device_, adam);
  if (step >= config_.vertexStartSteps) {
    RateSchedule schedule;
    schedule.rate = config_.vertexLearningRate;
    schedule.finalFactor = kFinalVertexFactor;
    schedule.constantFraction = 0;
    Adam vertices;
    vertices.rate = static_cast<float>(schedule.at(step, plannedSteps));
    vertices.skipZeroGradients = true;
    vertices.bound = 0.5f;  // a vertex stays in its cell
    model_.displacements().step(device_, vertices);
  }
  Adam exposureAdam;
  exposureAdam.rate = static_cast<float>(config_.exposureLearningRate * adam.rate / config_.learningRate);
  exposureAdam.skipZeroGradients = true;
  photoLoss_.exposures().step(exposureAdam, config_.exposure);
}

Bytes MeshTrainer::save(uint32_t) {
  TensorSet tensors;
  model_.save(tensors, true);
  photoLoss_.exposures().save(tensors);
  budget_.save(tensors);
  return tensors.encode({{"format", "tessera mesh 1"}, {"device", device_.target()}});
}

std::optional<uint32_t> MeshTrainer::firstNonFinitePart() {
  return model_.allFinite() && photoLoss_.exposures().allFinite() ? std::nullopt : std::optional<uint32_t>(0);
}

void MeshTrainer::restore(uint32_t, const fs::path& path, const Safetensors& state) {
  requireFormat(path, state, "tessera mesh 1", "mesh");
  warnOfOtherDevice(path, state, device_.target());
  model_.restore(path, state);
  photoLoss_.exposures().restore(path, state);
  budget_.restore(path, state);
}

}  // namespace tessera
