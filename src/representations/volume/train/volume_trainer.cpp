#include "representations/volume/train/volume_trainer.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "base/error.h"
#include "base/log.h"
#include "base/random.h"
#include "compute/losses.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

constexpr double kCapacityPerDemand = 1.5;            // reserve for steps that need more texels than the last one
constexpr uint32_t kLosses = PhotoLoss::kLosses + 1;  // PhotoLoss, then S3IM
constexpr uint32_t kGroup = 16;                       // rays come in groups of this size, which S3IM needs
constexpr const char* kFormat = "tessera volume 1";

PhotoRays::Settings raySettings(const VolumeConfig& config) {
  PhotoRays::Settings settings = config.photoRaySettings();
  settings.randomBackground = config.randomBackground;
  settings.nearFromSparseDepth = config.nearFromSparseDepth;
  settings.sparseDepthMargin = config.sparseDepthMargin;
  settings.jitters = VolumePipeline::kRounds + 1;
  return settings;
}

// Returns the grid of the level below; only approximately where its size was rounded to whole macroblocks.
VirtualGrid finerGrid(const VolumeConfig& config) {
  VirtualGrid grid = config.virtualGrid();
  grid.voxels *= 2;
  grid.planes *= 2;
  return grid;
}

VolumePipeline::Capacity makeCapacity(const VolumeConfig& config) {
  VolumePipeline::Capacity capacity;
  capacity.rays = static_cast<uint32_t>(config.maxRays);
  capacity.points = static_cast<uint32_t>(config.sparsityPoints);
  capacity.texels =
      static_cast<uint32_t>(kCapacityPerDemand * config.texelsPerStep) + VirtualGrid::kCorners * capacity.points;
  capacity.training = true;
  if (config.lod > 0) capacity.maxWords = finerGrid(config).words();
  return capacity;
}

}  // namespace

float cullThreshold(const VolumeConfig& config, double progress) {
  if (config.lod > 0) return static_cast<float>(config.cullLast);  // the finest level has reached it
  if (progress < config.cullBegin) return 0;
  const double way = std::min(1.0, (progress - config.cullBegin) / std::max(1e-9, config.cullEnd - config.cullBegin));
  return static_cast<float>(config.cullFirst * std::pow(config.cullLast / config.cullFirst, way));
}

VolumeTrainer::VolumeTrainer(Device& device, const Capture& capture, const VolumeConfig& config, const BlockGrid& grid,
                             const fs::path& waiting)
    : device_(device),
      config_(config),
      model_(device, config, grid, {static_cast<uint32_t>(config.residentBlocks), true}),
      pipeline_(model_, makeCapacity(config)),
      photoRays_(device, capture, model_.frame(), raySettings(config)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.maxRays)),
      budget_(config, kGroup) {
  losses_ = device.array<float>(kLosses);
  asSaved_.assign(parts(), false);
  if (config.blocksOnly || !model_.holdsAll()) tiles_ = tilePhotos(capture, model_.frame(), model_.space());
  photoCount_ = capture.photos.size();
  if (!model_.holdsAll()) {
    planResidentSets(waiting);
  } else if (config.blocksOnly) {
    drawFrom(std::vector<double>(tiles_.sets.size(), 1));
  }
}

// Draws rays in proportion to the shares of the sets; with blocksOnly, none from the set that contains no block.
void VolumeTrainer::drawFrom(std::vector<double> shareOfSet) {
  for (size_t set = 0; config_.blocksOnly && set < shareOfSet.size(); ++set) {
    if (tiles_.sets[set].empty()) shareOfSet[set] = 0;
  }
  photoRays_.drawFrom(computeTileShares(tiles_, shareOfSet, photoCount_));
}

void VolumeTrainer::planResidentSets(const fs::path& waiting) {
  CHECK(!waiting.empty());
  swap_.emplace(waiting);
  BlockSets sets{tiles_.sets, std::vector<double>(tiles_.sets.size())};
  for (const uint32_t set : tiles_.setOfTile) ++sets.weights[set];
  residency_.emplace(sets, Residency::Settings{model_.space().cells(), static_cast<uint32_t>(config_.residentBlocks),
                                               config_.residencySteps, static_cast<uint64_t>(config_.seed)});
}

// Assigns slots in the order of blocks, independently of what was resident before, so that a resumed run does not
// differ.
void VolumeTrainer::swapIn(size_t residentSet) {
  residentSet_ = residentSet;
  const Residency::ResidentSet& next = residency_->residentSets()[residentSet];
  std::vector<uint32_t> blocks = next.blocks;
  if (model_.space().blocks() > model_.space().cells()) blocks.push_back(model_.space().cells());
  const std::vector<uint32_t> before = model_.blockOfSlot();
  for (uint32_t slot = 0; slot < model_.slots(); ++slot) {
    if (blocks[slot] == before[slot]) continue;
    TensorSet fields;
    model_.saveFields(before[slot], fields, true);
    swap_->put(before[slot], fields.encode({{"format", kFormat}}));
  }
  model_.assignSlots(blocks);
  for (uint32_t slot = 0; slot < model_.slots(); ++slot) {
    if (blocks[slot] == before[slot] || !swap_->holds(blocks[slot])) continue;
    model_.restoreFields(blocks[slot], swap_->blockFile(blocks[slot]), swap_->get(blocks[slot]));
  }
  drawFrom(next.shareOfSet);
}

VolumePipeline::LossScales VolumeTrainer::lossScales(int64_t step, int64_t plannedSteps) const {
  // Regularisation must not start before a block has been trained on photos: with residency, it starts after the first
  // cycle.
  const bool haveSeenNothing = residency_ && config_.lod == 0;
  const int64_t into = step - (haveSeenNothing ? residency_->cycleSteps() : 0);
  double ramp = into < 0 ? 0 : 1;
  if (into >= 0 && config_.lossWarmupFraction > 0) {
    ramp = plannedSteps == 0 ? 0
                             : std::min(1.0, static_cast<double>(into) /
                                                 (config_.lossWarmupFraction * static_cast<double>(plannedSteps)));
  }
  const double perRay = 1.0 / budget_.rays();
  VolumePipeline::LossScales scales;
  scales.interlevel = static_cast<float>(config_.interlevelWeight * perRay);
  scales.distortion = static_cast<float>(config_.distortionWeight * ramp * perRay);
  scales.opacity = static_cast<float>(config_.opacityWeight * ramp * perRay);
  scales.sparsity = static_cast<float>(config_.sparsityWeight * ramp / std::max(1, config_.sparsityPoints));
  return scales;
}

VolumePipeline::Options VolumeTrainer::passOptions(int64_t step, double progress) const {
  constexpr double kAnnealSteps = 500;
  VolumePipeline::Options options;
  options.minAlpha = cullThreshold(config_, progress);
  options.seed = mix64(static_cast<uint64_t>(config_.seed) ^ (static_cast<uint64_t>(step) << 20));
  options.keepAttributes = !isFrozen(progress);
  bool warm = step >= config_.proposalWarmupSteps;
  double annealed = (static_cast<double>(step) + 1) / kAnnealSteps;
  if (residency_ && step < residency_->cycleSteps()) {  // the first time in memory for every resident block
    const Residency::Position position = residency_->at(step);
    const double length =
        std::min(kAnnealSteps, static_cast<double>(residency_->residentSets()[position.residentSet].steps));
    annealed = (static_cast<double>(position.stepsInto) + 1) / length;
    warm = false;
  }
  if (config_.lod > 0) annealed = 1;
  options.anneal = static_cast<float>(std::min(1.0, annealed));
  options.keepProposals = options.keepAttributes && (!warm || step % config_.proposalEvery == 0);
  return options;
}

VolumeRays VolumeTrainer::forward(int64_t step, const VolumePipeline::Options& options) {
  const uint32_t count = budget_.rays();
  photoRays_.draw(step, count);
  const VolumeRays rays{count,
                        photoRays_.origins(0, count),
                        photoRays_.directions(0, count),
                        photoRays_.jitters(),
                        photoRays_.fars(0, count),
                        photoRays_.nears(0, count)};
  pipeline_.forward(rays, options);
  return rays;
}

StepReport VolumeTrainer::step(int64_t step, int64_t plannedSteps) {
  // An unknown number of planned steps counts as the beginning of training.
  const double progress = plannedSteps > 0 ? static_cast<double>(step) / static_cast<double>(plannedSteps) : 0;
  if (residency_) {
    const size_t residentSet = residency_->at(step).residentSet;
    if (residentSet != residentSet_) swapIn(residentSet);
  }
  const VolumePipeline::Options options = passOptions(step, progress);
  if (config_.lod > 0) model_.setVirtualGrid(isFrozen(progress) ? finerGrid(config_) : config_.virtualGrid());
  std::vector<float> losses, inner;
  std::vector<uint32_t> texels, samples;
  do {
    const VolumeRays rays = forward(step, options);
    const PhotoLoss::Picture picture = addColourGradients(step);
    pipeline_.backward(rays, photoLoss_.colourGradients(picture), photoLoss_.opacityGradients(picture),
                       lossScales(step, plannedSteps));
    updateParameters(step, plannedSteps, options);
    // The step has finished, so its counters may be read. If its texels exceeded the capacity, it has changed nothing.
    std::tie(losses, inner, texels, samples) = device_.readAll(
        losses_.all(), pipeline_.losses(), pipeline_.texelsDemanded(), pipeline_.firstSample().part(rays.count, 1));
    // If rays demand more texels than the capacity, the excess is evaluated as fog, and the step is repeated with fewer
    // rays.
  } while (budget_.drawsFewer(texels[0], pipeline_.texelCapacity()));
  photoLoss_.exposures().settle(step, config_.exposure);

  for (const uint32_t block : model_.blockOfSlot()) asSaved_[block] = false;

  StepReport report;
  const uint32_t rays = budget_.rays();
  report.rays = rays;
  report.samples = samples[0];
  report.marched = rays * static_cast<uint32_t>(config_.firstIntervals + config_.secondIntervals);
  report.loss = losses[0] + losses[2];
  for (const float loss : inner) report.loss += loss;
  double weight = 0;
  for (const float w : photoRays_.batch().weights) weight += w;
  report.squaredError = losses[1] / std::max(1.0, 3 * weight);
  report.texels = std::max(1u, texels[0]);

  // Texels grow more slowly than rays, so the square root of the ratio is enough.
  const double targetRays = rays * std::sqrt(static_cast<double>(config_.texelsPerStep) / report.texels);
  budget_.aimFor(std::floor(targetRays / kGroup) * kGroup);
  return report;
}

PhotoLoss::Picture VolumeTrainer::addColourGradients(int64_t step) {
  const uint32_t rays = photoRays_.count();
  const PhotoLoss::Picture picture{{rays}, 0, rays, pipeline_.colour(), pipeline_.opacity()};
  photoLoss_.compare(photoRays_, picture, losses_.part(0, PhotoLoss::kLosses));
  if (config_.s3imWeight > 0) {
    S3imLoss similarity;
    similarity.scale = static_cast<float>(config_.s3imWeight);
    similarity.rays = picture.finished;
    similarity.seed = mix64(static_cast<uint64_t>(config_.seed) + static_cast<uint64_t>(step));
    similarity.predicted = photoLoss_.exposed(picture);
    similarity.target = photoRays_.targets(0, rays);
    similarity.weights = photoRays_.weights(0, rays);
    similarity.loss = losses_.part(PhotoLoss::kLosses, 1);
    similarity.gradients = photoLoss_.colourGradients(picture);
    device_.run(similarity);
  }
  photoLoss_.passBack(photoRays_, picture);
  return picture;
}

void VolumeTrainer::updateParameters(int64_t step, int64_t plannedSteps, const VolumePipeline::Options& options) {
  const float rate = static_cast<float>(config_.rateSchedule().at(step, plannedSteps));
  const float ofFields = config_.lod > 0 ? rate * static_cast<float>(config_.lodLearningRateFactor) : rate;
  Adam all;
  if (budget_.canShrink()) all.overflowCounters = pipeline_.texelsDemanded();
  all.capacity = pipeline_.texelCapacity();
  Adam table = all;
  table.rate = ofFields;
  table.skipZeroGradients = true;
  table.l2 = static_cast<float>(config_.tableL2);
  Adam network = all;
  network.rate = ofFields;
  network.skipZeroGradients = true;  // of blocks that no ray of the step reached
  network.l2 = static_cast<float>(config_.networkL2);
  for (uint32_t slot = 0; options.keepAttributes && slot < model_.slots(); ++slot) {
    Adam ofTable = table, ofNetwork = network;
    ofTable.rows = ofNetwork.rows = pipeline_.texelRows(slot);
    model_.attributes().table(slot).step(device_, ofTable);
    model_.attributes().network(slot).step(device_, ofNetwork);
    if (!options.keepProposals) continue;
    model_.proposals().table(slot).step(device_, table);
    model_.proposals().network(slot).step(device_, network);
  }
  network.rate = rate * static_cast<float>(config_.deferredLearningRateFactor);
  model_.deferred().step(device_, network);
  Adam ofExposures = all;
  ofExposures.rate = static_cast<float>(config_.exposureLearningRate / config_.learningRate) * rate;
  ofExposures.skipZeroGradients = true;
  photoLoss_.exposures().step(ofExposures, config_.exposure);
}

Bytes VolumeTrainer::save(uint32_t part) {
  TensorSet tensors;
  if (model_.findSlot(part) != kNoSlot) {
    model_.saveFields(part, tensors, true);
  } else if (swap_->holds(part)) {
    const Safetensors file = swap_->get(part);
    for (const auto& [name, tensor] : file.tensors) tensors.add(name, tensor);
  } else {
    model_.saveFirstFields(part, tensors);
  }
  if (part == 0) {
    model_.saveDeferred(tensors, true);
    photoLoss_.exposures().save(tensors);
    budget_.save(tensors);
  }
  asSaved_[part] = true;
  return tensors.encode({{"format", kFormat}, {"device", device_.target()}, {"block", std::to_string(part)}});
}

std::optional<uint32_t> VolumeTrainer::firstNonFinitePart() {
  for (uint32_t slot = 0; slot < model_.slots(); ++slot) {
    for (const ParameterGroup* group : {&model_.attributes().network(slot), &model_.attributes().table(slot),
                                        &model_.proposals().network(slot), &model_.proposals().table(slot)}) {
      if (!group->allFinite(device_)) return model_.blockOfSlot()[slot];
    }
  }
  if (!model_.deferred().allFinite(device_) || !photoLoss_.exposures().allFinite()) return 0;
  return std::nullopt;
}

void VolumeTrainer::restoreBlock(uint32_t block, const fs::path& path, const Safetensors& state) {
  if (model_.findSlot(block) != kNoSlot) {
    model_.restoreFields(block, path, state);
    return;
  }
  TensorSet fields;
  for (const auto& [name, tensor] : state.tensors) {
    if (name.starts_with("attributes.") || name.starts_with("proposals.")) fields.add(name, tensor);
  }
  swap_->put(block, fields.encode({{"format", kFormat}}));
}

void VolumeTrainer::beginFrom(const fs::path& below) {
  const ModelManifest manifest = requireManifest(ModelFolder(below), "volume");
  requireOneFileABlock(below, manifest, parts());
  for (uint32_t block = 0; block < parts(); ++block) {
    const fs::path path = below / manifest.files[block];
    Safetensors state = readSafetensors(path);
    std::erase_if(state.tensors, [](const auto& tensor) {  // keep values only, no moments
      return tensor.first.ends_with(".m1") || tensor.first.ends_with(".m2") || tensor.first.ends_with(".count");
    });
    restoreBlock(block, path, state);
  }
}

void VolumeTrainer::restore(uint32_t part, const fs::path& path, const Safetensors& state) {
  requireFormat(path, state, kFormat, "volume");
  restoreBlock(part, path, state);
  asSaved_[part] = true;
  if (part != 0) return;
  model_.restoreDeferred(path, state);
  warnOfOtherDevice(path, state, device_.target());
  photoLoss_.exposures().restore(path, state);
  budget_.restore(path, state);
}

}  // namespace tessera
