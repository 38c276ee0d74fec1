#include "representations/hash/hash_trainer.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "base/error.h"
#include "base/random.h"
#include "compute/block_path.h"
#include "compute/exposure.h"
#include "train/colour_loss.h"
#include "train/schedule.h"
#include "train/visible_cells.h"

namespace tessera {
namespace {

constexpr double kRoomPerWanted = 2;  // for steps that see more than the last one did
constexpr float kMinTransmittance = 1e-4f;
constexpr const char* kFormat = "tessera hash 1";

PhotoRays::Settings raySettings(const HashConfig& config) {
  PhotoRays::Settings settings;
  settings.seed = static_cast<uint64_t>(config.seed);
  settings.mostRays = static_cast<uint32_t>(config.mostRays);
  settings.photoBudgetMiB = config.photoBudgetMiB;
  settings.stepsPerPhoto = config.stepsPerPhoto;
  settings.randomBackground = config.background == "random";
  settings.knownShare = config.depth > 0 ? config.knownShare : 0;
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
      exposures_(device, capture),
      rays_(static_cast<uint32_t>(config.firstRays)) {
  CHECK(config.distortion.has_value());
  colourLossKind(config.loss);
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
  const size_t rays = static_cast<size_t>(config.mostRays);
  for (Array<float>* three : {&exposed_, &colourGradients_}) *three = device.array<float>(3 * rays);
  opacityGradients_ = device.array<float>(rays);
  losses_ = device.array<float>(2);
}

void HashTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0) return;
  model_.refreshOccupancy(step < config_.occupancyWarmUp,
                          mix64(static_cast<uint64_t>(config_.seed) ^ (static_cast<uint64_t>(step) << 20)));
}

HashModel::Rays HashTrainer::drawRays(int64_t step) {
  photoRays_.draw(step, rays_);
  const HashModel::Rays rays{rays_,
                             photoRays_.origins(0, rays_),
                             photoRays_.directions(0, rays_),
                             photoRays_.jitter(0, rays_),
                             photoRays_.nears(0, rays_),
                             photoRays_.fars(0, rays_)};
  pass_.forward(rays, kMinTransmittance);
  return rays;
}

// Where corners have no room, what they hold counts as nothing: then again with fewer rays.
bool HashTrainer::drawsFewerRays(uint32_t texelsWanted) {
  const double room = model_.fields().roomForTexels(), wanted = texelsWanted;
  if (wanted <= room || rays_ == 1) return false;
  rays_ = std::max(1u, static_cast<uint32_t>(0.9 * room / wanted * rays_));
  return true;
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
  exposures_.settle(step, config_.exposure);

  report.samples = counters[0];
  report.rays = counters[1];
  for (uint32_t round = 0; round < HashSamples::kRounds; ++round) report.marched += counters[2 + round];
  const Fit fit = fitOf(report.rays, losses);
  report.loss = fit.loss + inner[0] + inner[1];
  report.squaredError = fit.squaredError / std::max(1.0, fit.channels);
  const double perRay = static_cast<double>(report.samples) / std::max(1u, report.rays);
  model_.adaptStep(perRay);

  double wanted = config_.samplesPerStep / std::max(1.0 / 64, perRay);
  wanted = std::min(wanted, rays_ * static_cast<double>(config_.texelsPerStep) / std::max(1u, report.texels));
  if (report.rays < rays_) wanted = std::min<double>(wanted, report.rays);  // not all of them fitted
  rays_ = static_cast<uint32_t>(std::clamp<double>(std::ceil(wanted / 8) * 8, 8, config_.mostRays));
  return report;
}

void HashTrainer::trainOn(std::vector<TileShares> photos) {
  std::vector<int> trained;
  for (size_t photo = 0; photo < photos.size(); ++photo) {
    if (photos[photo].total() > 0) trained.push_back(static_cast<int>(photo));
  }
  exposures_.trainOn(std::move(trained));
  photoRays_.drawFrom(std::move(photos));
}

void HashTrainer::judgeBy(std::vector<TileShares> photos) {
  exposures_.centre();
  photoRays_.drawFrom(std::move(photos));
}

HashTrainer::Fit HashTrainer::fit(int64_t step) {
  std::vector<uint32_t> counters;
  std::vector<float> losses;
  do {
    compareWithPhotos(pass_.finished(drawRays(step)));
    std::tie(counters, losses) = device_.readTogether(pass_.counters(), losses_.all());
  } while (drawsFewerRays(*std::max_element(counters.begin() + HashSamples::kFirstTexels, counters.end())));
  return fitOf(counters[1], losses);
}

HashTrainer::Fit HashTrainer::fitOf(uint32_t rays, const std::vector<float>& losses) const {
  double weight = 0;
  for (uint32_t ray = 0; ray < rays; ++ray) weight += photoRays_.batch().weights[ray];
  return {losses[1], 3 * weight, losses[0]};
}

Slice<const float> HashTrainer::backgrounds() const {
  return config_.background == "random" ? photoRays_.backgrounds(0, rays_) : Slice<const float>();
}

// Losses of colours, and their gradients.
void HashTrainer::compareWithPhotos(Count rays) {
  device_.run(ExposureForward{rays, pass_.colour(), pass_.opacity(), backgrounds(), photoRays_.photoOfRay(0, rays_),
                              exposures_.logGains(), exposed_});
  ColourLoss loss;
  loss.kind = colourLossKind(config_.loss);
  loss.parameter = static_cast<float>(config_.lossParameter);
  loss.scale = 1.0f / (3.0f * static_cast<float>(rays_));
  loss.rays = rays;
  loss.predicted = exposed_;
  loss.target = photoRays_.targets(0, rays_);
  loss.weights = photoRays_.weights(0, rays_);
  loss.loss = losses_;
  loss.gradients = colourGradients_;
  device_.run(loss);
}

void HashTrainer::addGradients(const HashModel::Rays& drawn, int64_t step, int64_t plannedSteps) {
  const Count rays = pass_.finished(drawn);
  compareWithPhotos(rays);
  device_.fillZero(opacityGradients_.all());
  device_.run(ExposureBackward{rays, pass_.colour(), backgrounds(), photoRays_.photoOfRay(0, rays_),
                               exposures_.logGains(), colourGradients_, colourGradients_, opacityGradients_,
                               exposures_.gradients()});
  HashPass::LossScales scales;
  scales.distortion = static_cast<float>(distortionWeight(config_, step, plannedSteps) / rays_);
  if (config_.knownShare > 0) scales.depth = static_cast<float>(config_.depth / rays_);
  scales.depthTolerance = static_cast<float>(config_.depthTolerance);
  pass_.backward(drawn, colourGradients_, opacityGradients_, photoRays_.distances(0, rays_), scales);
}

void HashTrainer::updateParameters(int64_t step, int64_t plannedSteps) {
  RateSchedule schedule;
  schedule.rate = config_.rate;
  schedule.finalFactor = config_.finalRateFactor;
  schedule.constantFraction = config_.constantRateShare;
  schedule.warmUpSteps = config_.warmUpSteps;
  schedule.linear = config_.rateFall == "linear";
  HashFields::Rates rates;
  rates.table.rate = rates.network.rate = static_cast<float>(schedule.at(step, plannedSteps));
  rates.table.skipZeroGradients = rates.network.skipZeroGradients = true;
  rates.fine = rates.table;
  rates.fine.rate *= static_cast<float>(config_.fineRateFactor);
  rates.network.l2 = static_cast<float>(config_.networkL2);
  for (Adam* adam : {&rates.table, &rates.fine, &rates.network}) {
    if (rays_ > 1) adam->found = pass_.texelsWanted();
    adam->room = model_.fields().roomForTexels();
  }
  model_.fields().step(rates);
  model_.direction().step(device_, rates.network);
  Adam ofExposures = rates.table;
  ofExposures.rate = static_cast<float>(config_.exposureRate * rates.table.rate / config_.rate);
  exposures_.step(ofExposures, config_.exposure);
}

Bytes HashTrainer::save(uint32_t part) {
  TensorSet tensors;
  model_.save(part, tensors, true);
  if (part == 0) {
    exposures_.save(tensors);
    tensors.add("rays", std::vector<uint32_t>{rays_});
  }
  return tensors.encode({{"format", kFormat}, {"device", device_.target()}, {"block", std::to_string(part)}});
}

std::optional<uint32_t> HashTrainer::brokenPart() {
  for (uint32_t part = 0; part < parts(); ++part) {
    if (!model_.allFinite(part)) return part;
  }
  return exposures_.allFinite() ? std::nullopt : std::optional<uint32_t>(0);
}

void HashTrainer::restore(uint32_t part, const fs::path& path, const Safetensors& state) {
  requireFormat(path, state, kFormat, "hash");
  model_.restore(part, path, state);
  if (part != 0) return;
  warnOfOtherDevice(path, state, device_.target());
  exposures_.restore(path, state);
  const TensorView& rays = state.require(path, "rays", TensorType::u32);
  if (rays.elements() != 1) throw Error(path.string(), "tensor rays", "is not one number", "train again");
  rays_ = std::clamp(rays.as<uint32_t>()[0], 1u, static_cast<uint32_t>(config_.mostRays));
}

}  // namespace tessera
