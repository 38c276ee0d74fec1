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

constexpr double kRoomPerWanted = 1.5;                // for steps that need more texels than the last one did
constexpr uint32_t kLosses = PhotoLoss::kLosses + 1;  // of colours, S3IM
constexpr uint32_t kGroup = 16;                       // rays come in groups of so many, as S3IM wants them
constexpr const char* kFormat = "tessera volume 1";

PhotoRays::Settings raySettings(const VolumeConfig& config) {
  PhotoRays::Settings settings = config.photoRaySettings();
  settings.randomBackground = config.randomBackground;
  settings.freeSpace = config.freeSpace;
  settings.knownBracket = config.knownBracket;
  settings.jitters = VolumePass::kRounds + 1;
  return settings;
}

// Of the level below; nearly, where its size was rounded to whole macroblocks.
VirtualGrid finerGrid(const VolumeConfig& config) {
  VirtualGrid grid = config.virtualGrid();
  grid.voxels *= 2;
  grid.planes *= 2;
  return grid;
}

VolumePass::Room roomFor(const VolumeConfig& config) {
  VolumePass::Room room;
  room.rays = static_cast<uint32_t>(config.mostRays);
  room.points = static_cast<uint32_t>(config.sparsityPoints);
  room.texels = static_cast<uint32_t>(kRoomPerWanted * config.texelsPerStep) + VirtualGrid::kCorners * room.points;
  room.training = true;
  if (config.level > 0) room.mostWords = finerGrid(config).words();
  return room;
}

}  // namespace

float cullThreshold(const VolumeConfig& config, double progress) {
  if (config.level > 0) return static_cast<float>(config.cullLast);  // the finest has come to it
  if (progress < config.cullBegin) return 0;
  const double way = std::min(1.0, (progress - config.cullBegin) / std::max(1e-9, config.cullEnd - config.cullBegin));
  return static_cast<float>(config.cullFirst * std::pow(config.cullLast / config.cullFirst, way));
}

VolumeTrainer::VolumeTrainer(Device& device, const Capture& capture, const VolumeConfig& config, const BlockGrid& grid,
                             const fs::path& waiting)
    : device_(device),
      config_(config),
      model_(device, config, grid, {static_cast<uint32_t>(config.residentBlocks), true}),
      pass_(model_, roomFor(config)),
      photoRays_(device, capture, model_.frame(), raySettings(config)),
      photoLoss_(device, capture, config, static_cast<uint32_t>(config.mostRays)),
      budget_(config, kGroup) {
  losses_ = device.array<float>(kLosses);
  asSaved_.assign(parts(), false);
  if (config.blocksOnly || !model_.holdsAll()) tiles_ = tilePhotos(capture, model_.frame(), model_.space());
  photoCount_ = capture.photos.size();
  if (!model_.holdsAll()) {
    planStays(waiting);
  } else if (config.blocksOnly) {
    drawFrom(std::vector<double>(tiles_.sets.size(), 1));
  }
}

// Of each set's share, or less.
void VolumeTrainer::drawFrom(std::vector<double> shareOfSet) {
  for (size_t set = 0; config_.blocksOnly && set < shareOfSet.size(); ++set) {
    if (tiles_.sets[set].empty()) shareOfSet[set] = 0;
  }
  photoRays_.drawFrom(sharesOf(tiles_, shareOfSet, photoCount_));
}

void VolumeTrainer::planStays(const fs::path& waiting) {
  CHECK(!waiting.empty());
  waiting_.emplace(waiting);
  BlockSets sets{tiles_.sets, std::vector<double>(tiles_.sets.size())};
  for (const uint32_t set : tiles_.setOfTile) ++sets.weights[set];
  residency_.emplace(sets, Residency::Settings{model_.space().cells(), static_cast<uint32_t>(config_.residentBlocks),
                                               config_.residencySteps, static_cast<uint64_t>(config_.seed)});
}

// Slots in the order of blocks, whatever was in memory before: a resumed run must not differ.
void VolumeTrainer::moveIn(size_t stay) {
  stay_ = stay;
  const Residency::Stay& next = residency_->stays()[stay];
  std::vector<uint32_t> blocks = next.blocks;
  if (model_.space().blocks() > model_.space().cells()) blocks.push_back(model_.space().cells());
  const std::vector<uint32_t> before = model_.blockOfSlot();
  for (uint32_t slot = 0; slot < model_.slots(); ++slot) {
    if (blocks[slot] == before[slot]) continue;
    TensorSet fields;
    model_.saveFields(before[slot], fields, true);
    waiting_->put(before[slot], fields.encode({{"format", kFormat}}));
  }
  model_.hold(blocks);
  for (uint32_t slot = 0; slot < model_.slots(); ++slot) {
    if (blocks[slot] == before[slot] || !waiting_->holds(blocks[slot])) continue;
    model_.restoreFields(blocks[slot], waiting_->fileOf(blocks[slot]), waiting_->get(blocks[slot]));
  }
  drawFrom(next.shareOfSet);
}

VolumePass::LossScales VolumeTrainer::lossScales(int64_t step, int64_t plannedSteps) const {
  // Blocks must have seen something before they are asked to decide: those that wait get their first turn without.
  const bool haveSeenNothing = residency_ && config_.level == 0;
  const int64_t into = step - (haveSeenNothing ? residency_->cycleSteps() : 0);
  double ramp = into < 0 ? 0 : 1;
  if (into >= 0 && config_.rampShare > 0) {
    ramp = plannedSteps == 0
               ? 0
               : std::min(1.0, static_cast<double>(into) / (config_.rampShare * static_cast<double>(plannedSteps)));
  }
  const double perRay = 1.0 / budget_.rays();
  VolumePass::LossScales scales;
  scales.interlevel = static_cast<float>(config_.interlevel * perRay);
  scales.distortion = static_cast<float>(config_.distortion * ramp * perRay);
  scales.opacity = static_cast<float>(config_.opacity * ramp * perRay);
  scales.sparsity = static_cast<float>(config_.sparsity * ramp / std::max(1, config_.sparsityPoints));
  return scales;
}

VolumePass::Options VolumeTrainer::passOptions(int64_t step, double progress) const {
  constexpr double kAnnealSteps = 500;
  VolumePass::Options options;
  options.minAlpha = cullThreshold(config_, progress);
  options.seed = mix64(static_cast<uint64_t>(config_.seed) ^ (static_cast<uint64_t>(step) << 20));
  options.keepAttributes = !isFrozen(progress);
  bool warm = step >= config_.proposalWarmUp;
  double annealed = (static_cast<double>(step) + 1) / kAnnealSteps;
  if (residency_ && step < residency_->cycleSteps()) {  // the first time for all that is there
    const Residency::Place place = residency_->at(step);
    const double length = std::min(kAnnealSteps, static_cast<double>(residency_->stays()[place.stay].steps));
    annealed = (static_cast<double>(place.stepsInto) + 1) / length;
    warm = false;
  }
  if (config_.level > 0) annealed = 1;
  options.anneal = static_cast<float>(std::min(1.0, annealed));
  options.keepProposals = options.keepAttributes && (!warm || step % config_.proposalEvery == 0);
  return options;
}

VolumeRays VolumeTrainer::forward(int64_t step, const VolumePass::Options& options) {
  const uint32_t count = budget_.rays();
  photoRays_.draw(step, count);
  const VolumeRays rays{count,
                        photoRays_.origins(0, count),
                        photoRays_.directions(0, count),
                        photoRays_.jitters(),
                        photoRays_.fars(0, count),
                        photoRays_.nears(0, count)};
  pass_.forward(rays, options);
  return rays;
}

StepReport VolumeTrainer::step(int64_t step, int64_t plannedSteps) {
  // While the number of steps is not known, it is early.
  const double progress = plannedSteps > 0 ? static_cast<double>(step) / static_cast<double>(plannedSteps) : 0;
  if (residency_) {
    const size_t stay = residency_->at(step).stay;
    if (stay != stay_) moveIn(stay);
  }
  const VolumePass::Options options = passOptions(step, progress);
  if (config_.level > 0) model_.lookThrough(isFrozen(progress) ? finerGrid(config_) : config_.virtualGrid());
  std::vector<float> losses, inner;
  std::vector<uint32_t> texels, samples;
  do {
    const VolumeRays rays = forward(step, options);
    const PhotoLoss::Picture picture = addColourGradients(step);
    pass_.backward(rays, photoLoss_.colourGradients(picture), photoLoss_.opacityGradients(picture),
                   lossScales(step, plannedSteps));
    updateParameters(step, plannedSteps, options);
    // The step is over: its counters may be read. Where it had no room, it has changed nothing.
    std::tie(losses, inner, texels, samples) = device_.readTogether(losses_.all(), pass_.losses(), pass_.texelsWanted(),
                                                                    pass_.firstSample().part(rays.count, 1));
    // Where rays want more texels than there is room for, what has none is fog: then again with fewer rays.
  } while (budget_.drawsFewer(texels[0], pass_.roomForTexels()));
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

  // Texels grow more slowly than rays, so half of the way is enough.
  const double wanted = rays * std::sqrt(static_cast<double>(config_.texelsPerStep) / report.texels);
  budget_.aimFor(std::floor(wanted / kGroup) * kGroup);
  return report;
}

PhotoLoss::Picture VolumeTrainer::addColourGradients(int64_t step) {
  const uint32_t rays = photoRays_.count();
  const PhotoLoss::Picture picture{{rays}, 0, rays, pass_.colour(), pass_.opacity()};
  photoLoss_.compare(photoRays_, picture, losses_.part(0, PhotoLoss::kLosses));
  if (config_.s3im > 0) {
    S3imLoss similarity;
    similarity.scale = static_cast<float>(config_.s3im);
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

void VolumeTrainer::updateParameters(int64_t step, int64_t plannedSteps, const VolumePass::Options& kept) {
  const float rate = static_cast<float>(config_.rateSchedule().at(step, plannedSteps));
  const float ofFields = config_.level > 0 ? rate * static_cast<float>(config_.levelRateFactor) : rate;
  Adam all;
  if (budget_.canShrink()) all.found = pass_.texelsWanted();
  all.room = pass_.roomForTexels();
  Adam table = all;
  table.rate = ofFields;
  table.skipZeroGradients = true;
  table.l2 = static_cast<float>(config_.tableL2);
  Adam network = all;
  network.rate = ofFields;
  network.skipZeroGradients = true;  // of blocks that no ray of the step came to
  network.l2 = static_cast<float>(config_.networkL2);
  for (uint32_t slot = 0; kept.keepAttributes && slot < model_.slots(); ++slot) {
    Adam ofTable = table, ofNetwork = network;
    ofTable.rows = ofNetwork.rows = pass_.texelRows(slot);
    model_.attributes().table(slot).step(device_, ofTable);
    model_.attributes().network(slot).step(device_, ofNetwork);
    if (!kept.keepProposals) continue;
    model_.proposals().table(slot).step(device_, table);
    model_.proposals().network(slot).step(device_, network);
  }
  network.rate = rate * static_cast<float>(config_.deferredRateFactor);
  model_.deferred().step(device_, network);
  Adam ofExposures = all;
  ofExposures.rate = static_cast<float>(config_.exposureRate / config_.rate) * rate;
  ofExposures.skipZeroGradients = true;
  photoLoss_.exposures().step(ofExposures, config_.exposure);
}

Bytes VolumeTrainer::save(uint32_t part) {
  TensorSet tensors;
  if (model_.slotOf(part) != kNoSlot) {
    model_.saveFields(part, tensors, true);
  } else if (waiting_->holds(part)) {
    const Safetensors file = waiting_->get(part);
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

std::optional<uint32_t> VolumeTrainer::brokenPart() {
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
  if (model_.slotOf(block) != kNoSlot) {
    model_.restoreFields(block, path, state);
    return;
  }
  TensorSet fields;
  for (const auto& [name, tensor] : state.tensors) {
    if (name.starts_with("attributes.") || name.starts_with("proposals.")) fields.add(name, tensor);
  }
  waiting_->put(block, fields.encode({{"format", kFormat}}));
}

void VolumeTrainer::beginFrom(const fs::path& below) {
  const ModelManifest manifest = requireManifest(ModelFolder(below), "volume");
  requireOneFileABlock(below, manifest, parts());
  for (uint32_t block = 0; block < parts(); ++block) {
    const fs::path path = below / manifest.files[block];
    Safetensors state = readSafetensors(path);
    std::erase_if(state.tensors, [](const auto& tensor) {  // values alone
      return tensor.first.ends_with(".m1") || tensor.first.ends_with(".m2") || tensor.first.ends_with(".count");
    });
    restoreBlock(block, path, state);
    if (block == 0) photoLoss_.exposures().restore(path, state);
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
