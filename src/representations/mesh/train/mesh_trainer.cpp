#include "representations/mesh/train/mesh_trainer.h"

#include <algorithm>
#include <cmath>

#include "base/log.h"
#include "base/random.h"
#include "compute/composite.h"
#include "compute/cube_map.h"
#include "compute/losses.h"
#include "representations/mesh/train/mesh_schedule.h"
#include "train/colour_loss.h"

namespace tessera {
namespace {

constexpr uint32_t kCapacityPerDemand = 2;                // for steps that need more than the last one
constexpr uint32_t kMaxFirstHits = 1024;                  // of a ray, before most cells are empty
constexpr uint32_t kMaxTrainingHits = 256;                // of a ray, afterwards
constexpr uint32_t kLosses = 2 * PhotoLoss::kLosses + 2;  // of a level: of both images, distortion, depth
constexpr uint32_t kRaysPerCoarseRay = 4;
// After one of this many updates of the occupancy, the neighbours of occupied cells are traced, too. Most hits would be
// in them, and nearly all of these are transparent.
constexpr int64_t kUpdatesPerExploration = 8;
constexpr float kMinTrainingTransmittance = 1e-4f;
constexpr double kFinalVertexFactor = 0.01;
constexpr double kFinalStageRate = 0.3;  // of the learning rate, at the beginning of the final stage
// With `--minutes`, the number of steps is known only after a quarter of the time: until then the rate must not depend
// on it.
constexpr double kConstantVertexFraction = 0.3;

PhotoRays::Settings raySettings(const MeshConfig& config, const std::vector<TileShares>& tiles) {
  PhotoRays::Settings settings = config.photoRaySettings();
  // Photos that show nothing of the part are not decoded.
  for (size_t photo = 0; photo < tiles.size(); ++photo)
    if (tiles[photo].total() > 0) settings.photos.push_back(static_cast<int>(photo));
  settings.randomBackground = config.randomBackground;
  if (config.depthWeight <= 0) settings.sparseDepthRayFraction = 0;
  return settings;
}

}  // namespace

MeshTrainer::MeshTrainer(Device& device, const Capture& capture, const MeshConfig& config, const MeshPart& part,
                         MeshStart start)
    : device_(device),
      capture_(capture),
      config_(config),
      model_(device, config, part),
      photoRays_(device, capture, part.frame, raySettings(config, start.tiles)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.maxRays)),
      budget_(config),
      finalStage_(model_, capture, start.tiles, start.pixelWidth) {
  if (config.coarseCells || part.isBackground()) model_.level(0).exclude(start.cells);
  if (!start.displacements.empty())
    device.write(model_.level(0).displacements().values.all(), std::span<const float>(start.displacements));
  const double pixels = start.pixels();
  photoRays_.drawFrom(std::move(start.tiles));
  const uint32_t rays = static_cast<uint32_t>(config.maxRays);
  const uint32_t samples =  // at least one ray fits
      std::max(kCapacityPerDemand * static_cast<uint32_t>(config.samplesPerStep), kMaxFirstHits);
  hits_ = MeshHits(device, rays, samples);
  const size_t levels = config.levels();
  counters_ = device.array<uint32_t>((levels + 1) * MeshHits::kCounters);
  model_.field().reserve(samples);
  for (Array<float>* perRay : {&opacity_, &opaqueOpacity_}) *perRay = device.array<float>(rays);
  for (Array<float>* perRay : {&colour_, &opaqueColour_, &skyColour_}) *perRay = device.array<float>(size_t{rays} * 3);
  losses_ = device.array<float>(levels * kLosses + PhotoLoss::kLosses);
  for (Array<float>* perSample : {&sampleWeights_, &sampleSteps_, &weightGradients_, &logitGradients_})
    *perSample = device.array<float>(samples);
  for (Array<float>* perSample : {&sampleColourGradients_, &positionGradients_})
    *perSample = device.array<float>(size_t{samples} * 3);
  // They are not drawn more densely than other rays: the coarse field may be wrong about few pixels.
  throughShare_ = std::min(config.throughShare, start.through.total() / std::max(1.0, pixels));
  if (throughShare_ <= 0) return;
  throughRays_.emplace(device, capture, part.frame, std::move(start.through), static_cast<uint64_t>(config.seed), rays);
  rayOpacityGradients_ = device.array<float>(rays);
  zeros_ = device.array<float>(std::max(rays, samples * MeshField::kFeatures));
}

void MeshTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0 || step < config_.occupancyStartSteps) return;
  const bool explores = step / config_.occupancyEvery % kUpdatesPerExploration == 0;
  for (uint32_t level = 0; level < model_.levels(); ++level) {
    // Without hits of recent steps all cells would become empty, and none would be hit again.
    if (level == 0 || movesVertices(step)) model_.level(level).refreshOccupancy(explores);
  }
}

// What lies behind a ray's last hit is not trained, and becomes empty. With the default decay, cells that no ray
// reaches do so in the 14th update.
uint32_t MeshTrainer::maxHits(int64_t step) const {
  constexpr int64_t kUpdates = 16;
  return step < config_.occupancyStartSteps + kUpdates * config_.occupancyEvery ? kMaxFirstHits : kMaxTrainingHits;
}

bool MeshTrainer::isFinalStage(int64_t step, int64_t plannedSteps) const {
  return plannedSteps > 0 && step >= config_.stepsBeforeFinalStage(plannedSteps);
}

// Its rate falls, over the final stage, from kFinalStageRate to the final factor of the rate of all steps.
StepReport MeshTrainer::finalStep(int64_t step, int64_t plannedSteps) {
  if (!finalStage_.hasBegun()) finalStage_.begin();
  photoRays_.draw(step, budget_.rays(), FinalStage::kSquareOfRays);
  finalStage_.addGradients(photoRays_, photoLoss_);
  const int64_t first = config_.stepsBeforeFinalStage(plannedSteps);
  const double done =
      static_cast<double>(step - first) / static_cast<double>(std::max<int64_t>(1, plannedSteps - first));
  updateNetworks(config_.learningRate * kFinalStageRate *
                 std::pow(config_.finalLearningRateFactor / kFinalStageRate, done));
  finalStage_.trainCoarserLevels(photoRays_, photoLoss_, done);

  const StepReport report = finalStage_.report(photoRays_);
  double target = config_.samplesPerStep * static_cast<double>(report.rays) / std::max(1u, report.texels);
  if (report.rays < photoRays_.count()) target = std::min<double>(target, report.rays);
  constexpr double kRaysOfSquare = FinalStage::kSquareOfRays * FinalStage::kSquareOfRays;
  budget_.aimFor(std::ceil(target / kRaysOfSquare) * kRaysOfSquare);
  if (step + 1 == plannedSteps) finalStage_.updateCoverage("after");  // opacities have changed since it began
  return report;
}

StepReport MeshTrainer::step(int64_t step, int64_t plannedSteps) {
  if (isFinalStage(step, plannedSteps)) return finalStep(step, plannedSteps);
  plannedSteps = config_.stepsBeforeFinalStage(plannedSteps);
  finalStage_.undo();
  refreshOccupancy(step);
  if (!config_.fitsLevels() && MeshSchedule::period(step, plannedSteps) > 0 && model_.levels() == 1)
    model_.addCoarseLevels(mix64(static_cast<uint64_t>(config_.seed)));
  const uint32_t rays = budget_.rays();
  photoRays_.draw(step, rays);
  for (uint32_t level = 0; level < model_.levels(); ++level) addGradients(level, step, plannedSteps);
  const bool drawsThrough = addThroughGradients(step) > 0;
  updateNetworks(config_.rateSchedule().at(step, plannedSteps));
  if (movesVertices(step)) updateVertices(step, plannedSteps);

  // The step is over, so its counters may be read.
  const auto [counters, losses] = device_.readAll(counters_.all(), losses_.all());
  StepReport report;
  const auto countHits = [&](uint32_t all) { return std::min(all, static_cast<uint32_t>(hits_.distances.size())); };
  report.samples = report.marched = countHits(counters[0]);
  report.rays = counters[1];
  constexpr uint32_t kColours = PhotoLoss::kLosses;
  report.loss = losses[0] + losses[kColours] + losses[2 * kColours] + losses[2 * kColours + 1];
  if (drawsThrough) {
    report.samples += countHits(counters[counters.size() - MeshHits::kCounters]);
    report.loss += losses[losses.size() - PhotoLoss::kLosses];
  }
  double weight = 0;
  for (uint32_t ray = 0; ray < report.rays; ++ray) weight += photoRays_.batch().weights[ray];
  report.squaredError = losses[1] / std::max(1.0, 3 * weight);
  const double perRay = std::max(1.0, static_cast<double>(report.samples)) / std::max(1u, report.rays);
  double targetRays = config_.samplesPerStep / perRay;
  if (report.rays < rays) targetRays = std::min<double>(targetRays, report.rays);  // not all rays fitted
  budget_.aimFor(std::ceil(targetRays / 8) * 8);
  return report;
}

void MeshTrainer::addGradients(uint32_t number, int64_t step, int64_t plannedSteps) {
  const bool isFinest = number == 0, moves = movesVertices(step);
  if (!isFinest && !moves) return;
  const uint32_t rays = isFinest ? photoRays_.count() : std::max(1u, photoRays_.count() / kRaysPerCoarseRay);
  const Slice<const float> directions = photoRays_.directions(0, rays);
  MeshLevel& level = model_.level(number);
  hits_.counters = counters_.part(size_t{number} * MeshHits::kCounters, MeshHits::kCounters);
  const MeshRays traced{rays, photoRays_.origins(0, rays), directions, {}};
  level.trace(traced, maxHits(step), false, hits_);
  const Count samples = hits_.samples();
  const MeshField::Output output =
      model_.field().forward(samples, hits_.positions, directions, hits_.rayOfSample, true);
  level.addOccupancy(traced, hits_, output.logits);

  // Losses are means over the rays of the step, of which this level may use a part.
  const Batch batch{rays, isFinest, static_cast<double>(photoRays_.count()) / rays, output,
                    losses_.part(size_t{number} * kLosses, kLosses)};
  const bool hasSecond = config_.opaqueLoss && !model_.part().isBackground();
  const double firstWeight = hasSecond ? MeshSchedule::firstWeight(step, plannedSteps) : 1;
  addVolumeLoss(batch, firstWeight);
  addOpaqueLoss(batch, 1 - firstWeight, MeshSchedule::threshold(step, plannedSteps));
  model_.field().backward(samples, hits_.positions, logitGradients_, Matrix<const float>(sampleColourGradients_, 3),
                          isFinest, moves ? positionGradients_.all() : Slice<float>());
  if (moves) level.backward(traced, hits_, positionGradients_);
}

void MeshTrainer::addVolumeLoss(const Batch& batch, double weight) {
  const Count finished = hits_.finished(batch.rays);
  CompositeForward composite;
  composite.extinction = Extinction::logit;
  composite.offset = model_.opacityOffset();
  composite.minTransmittance = kMinTrainingTransmittance;
  composite.rays = finished;
  composite.firstSample = hits_.firstSample;
  composite.x = batch.output.logits;
  composite.colours = batch.output.colours;
  composite.colour = colour_;
  composite.opacity = opacity_;
  composite.weights = sampleWeights_;
  const bool hasSky = model_.part().isBackground();
  const Slice<const float> directions = photoRays_.directions(0, batch.rays);
  if (hasSky) {
    device_.run(CubeMapForward{MeshModel::kSkyResolution, finished, directions, model_.sky().values, skyColour_});
    composite.background = skyColour_;
  }
  device_.run(composite);
  PhotoLoss::Picture picture{finished, 0, batch.rays, colour_.part(0, size_t{3} * batch.rays),
                             opacity_.part(0, batch.rays)};
  picture.standsBeforeBackgrounds = !hasSky;
  picture.weight = static_cast<float>(batch.mean * weight);
  picture.trainsExposures = false;
  photoLoss_.compare(photoRays_, picture, batch.losses.part(0, PhotoLoss::kLosses));
  photoLoss_.passBack(photoRays_, picture);
  if (hasSky) {
    device_.run(CubeMapBackward{MeshModel::kSkyResolution, finished, directions, opacity_,
                                photoLoss_.colourGradients(picture), model_.sky().gradients});
  }

  CompositeBackward back;
  back.extinction = composite.extinction;
  back.offset = composite.offset;
  back.minTransmittance = kMinTrainingTransmittance;
  back.rays = finished;
  back.firstSample = hits_.firstSample;
  back.x = batch.output.logits;
  back.colours = batch.output.colours;
  back.background = composite.background;
  back.rayColourGradients = photoLoss_.colourGradients(picture);
  back.rayOpacityGradients = photoLoss_.opacityGradients(picture);
  if (config_.distortionWeight > 0) {
    DistortionLoss distortion;
    distortion.scale = static_cast<float>(config_.distortionWeight) / static_cast<float>(batch.rays);
    distortion.rays = finished;
    distortion.firstSample = hits_.firstSample;
    distortion.weights = sampleWeights_;
    distortion.distances = hits_.distances;
    distortion.steps = sampleSteps_;  // zero: hits have no extent along the ray
    distortion.loss = batch.losses.part(2 * PhotoLoss::kLosses, 1);
    distortion.weightGradients = weightGradients_;
    device_.run(distortion);
    back.weightGradients = weightGradients_;
  }
  if (config_.depthWeight > 0 && config_.sparseDepthRayFraction > 0) {
    if (config_.distortionWeight <= 0) device_.fillZero(weightGradients_.all());
    DepthLoss depth;
    depth.scale = static_cast<float>(config_.depthWeight) / static_cast<float>(batch.rays);
    depth.tolerance = static_cast<float>(config_.depthTolerance);
    depth.rays = finished;
    depth.firstSample = hits_.firstSample;
    depth.weights = sampleWeights_;
    depth.distances = hits_.distances;
    depth.known = photoRays_.distances(0, batch.rays);
    depth.loss = batch.losses.part(2 * PhotoLoss::kLosses + 1, 1);
    depth.weightGradients = weightGradients_;
    device_.run(depth);
    back.weightGradients = weightGradients_;
  }
  back.xGradients = logitGradients_;
  back.colourGradients = Matrix<float>(sampleColourGradients_, 3);
  device_.run(back);
}

void MeshTrainer::addOpaqueLoss(const Batch& batch, double weight, double threshold) {
  const Slice<float> losses = batch.losses.part(PhotoLoss::kLosses, PhotoLoss::kLosses);
  if (weight <= 0) {
    device_.fillZero(losses);
    return;
  }
  const Count finished = hits_.finished(batch.rays);
  OpaqueForward opaque;
  opaque.threshold = static_cast<float>(threshold);
  opaque.offset = model_.opacityOffset();
  opaque.rays = finished;
  opaque.firstSample = hits_.firstSample;
  opaque.x = batch.output.logits;
  opaque.colours = batch.output.colours;
  opaque.colour = opaqueColour_;
  opaque.opacity = opaqueOpacity_;
  device_.run(opaque);
  PhotoLoss::Picture picture{finished, 0, batch.rays, opaqueColour_.part(0, size_t{3} * batch.rays),
                             opaqueOpacity_.part(0, batch.rays)};
  picture.standsBeforeBackgrounds = picture.comparesTransparent = false;  // its colours are normalised
  picture.weight = static_cast<float>(batch.mean * weight);
  picture.trainsExposures = false;
  photoLoss_.compare(photoRays_, picture, losses);
  photoLoss_.passBack(photoRays_, picture);

  OpaqueBackward back;
  back.threshold = opaque.threshold;
  back.offset = opaque.offset;
  back.rays = finished;
  back.firstSample = hits_.firstSample;
  back.x = batch.output.logits;
  back.colours = batch.output.colours;
  back.colour = opaqueColour_;
  back.rayColourGradients = photoLoss_.colourGradients(picture);
  back.xGradients = logitGradients_;
  back.colourGradients = Matrix<float>(sampleColourGradients_, 3);
  device_.run(back);
}

uint32_t MeshTrainer::addThroughGradients(int64_t step) {
  if (!throughRays_) return 0;
  // The colour loss takes the opacities of three rays as one colour.
  constexpr uint32_t kOpacitiesPerColour = 3;
  const auto colours = static_cast<uint32_t>(throughShare_ * photoRays_.count() / kOpacitiesPerColour);
  const uint32_t rays = kOpacitiesPerColour * colours;
  if (rays == 0) return 0;
  throughRays_->draw(step, rays);
  hits_.counters = counters_.part(counters_.size() - MeshHits::kCounters, MeshHits::kCounters);
  model_.level(0).trace(throughRays_->rays(), maxHits(step), false, hits_);
  const Count samples = hits_.samples(), finished = hits_.finished(rays);
  model_.field().encodeForBackward(samples, hits_.positions);

  CompositeForward composite;
  composite.extinction = Extinction::logit;
  composite.offset = model_.opacityOffset();
  composite.minTransmittance = kMinTrainingTransmittance;
  composite.rays = finished;
  composite.firstSample = hits_.firstSample;
  composite.x = model_.field().encodedFeatures().columnRange(0, 1);
  composite.opacity = opacity_;
  composite.weights = sampleWeights_;
  device_.fillZero(opacity_.part(0, rays));  // of rays whose hits do not fit
  device_.run(composite);

  // As if a photo showed the background there: each of these rays counts as much as one of a photo.
  ColourLoss loss;
  loss.kind = colourLossKind(config_.loss);
  loss.parameter = static_cast<float>(config_.lossParameter);
  loss.scale = 1 / static_cast<float>(photoRays_.count());
  loss.rays = {colours, {}};
  loss.predicted = opacity_.part(0, rays);
  loss.target = zeros_.part(0, rays);
  loss.loss = losses_.part(losses_.size() - PhotoLoss::kLosses, PhotoLoss::kLosses);
  loss.gradients = rayOpacityGradients_.part(0, rays);
  device_.run(loss);

  CompositeBackward back;
  back.extinction = composite.extinction;
  back.offset = composite.offset;
  back.minTransmittance = composite.minTransmittance;
  back.rays = finished;
  back.firstSample = hits_.firstSample;
  back.x = composite.x;
  back.rayOpacityGradients = rayOpacityGradients_;
  back.xGradients = logitGradients_;
  device_.run(back);
  model_.field().encodeBackward(samples, hits_.positions, Matrix<const float>(zeros_, MeshField::kFeatures),
                                logitGradients_);
  return rays;
}

void MeshTrainer::updateNetworks(double rate) {
  Adam adam;
  adam.rate = static_cast<float>(rate);
  adam.skipZeroGradients = true;
  model_.field().table().step(device_, adam);
  adam.skipZeroGradients = false;
  adam.l2 = static_cast<float>(config_.networkL2);
  model_.field().encoder().step(device_, adam);
  model_.field().decoder().step(device_, adam);
  if (model_.part().isBackground()) {
    adam.l2 = 0;
    adam.skipZeroGradients = true;
    model_.sky().step(device_, adam);
  }
}

void MeshTrainer::updateVertices(int64_t step, int64_t steps) {
  RateSchedule schedule;
  schedule.rate = config_.vertexLearningRate;
  schedule.finalFactor = kFinalVertexFactor;
  schedule.constantFraction = kConstantVertexFraction;
  Adam vertices;
  vertices.rate = static_cast<float>(schedule.at(step, steps));
  vertices.skipZeroGradients = true;
  vertices.bound = kMaxDisplacement;
  for (uint32_t level = 0; level < model_.levels(); ++level)
    model_.level(level).displacements().step(device_, vertices);
}

Bytes MeshTrainer::save(uint32_t) {
  TensorSet tensors;
  model_.save(tensors, true);
  budget_.save(tensors);
  return tensors.encode({{"format", "tessera mesh 1"}, {"device", device_.target()}});
}

std::optional<uint32_t> MeshTrainer::firstNonFinitePart() {
  return model_.allFinite() ? std::nullopt : std::optional<uint32_t>(0);
}

void MeshTrainer::restore(uint32_t, const fs::path& path, const Safetensors& state) {
  requireFormat(path, state, "tessera mesh 1", "mesh");
  warnOfOtherDevice(path, state, device_.target());
  model_.restore(path, state);
  budget_.restore(path, state);
}

}  // namespace tessera
