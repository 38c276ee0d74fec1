#include "representations/volume/volume_trainer.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "base/error.h"
#include "base/log.h"
#include "base/random.h"
#include "compute/exposure.h"
#include "train/colour_loss.h"
#include "train/run_folder.h"
#include "train/schedule.h"

namespace tessera {
namespace {

constexpr double kRoomPerWanted = 1.5;  // for steps that need more texels than the last one did
constexpr uint32_t kLosses = 3;         // colour loss, squared error, S3IM
constexpr uint32_t kGroup = 16;         // rays come in groups of so many, as S3IM wants them
constexpr const char* kFormat = "tessera volume 1";

PhotoRays::Settings raySettings(const VolumeConfig& config) {
  PhotoRays::Settings settings;
  settings.seed = static_cast<uint64_t>(config.seed);
  settings.mostRays = static_cast<uint32_t>(config.mostRays);
  settings.photoBudgetMiB = config.photoBudgetMiB;
  settings.stepsPerPhoto = config.stepsPerPhoto;
  settings.randomBackground = config.randomBackground;
  settings.freeSpace = config.freeSpace;
  settings.knownShare = config.knownShare;
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
      exposures_(device, capture),
      rays_(static_cast<uint32_t>(config.firstRays) / kGroup * kGroup) {
  colourLossKind(config.loss);
  const size_t rays = static_cast<size_t>(config.mostRays);
  for (Array<float>* three : {&exposed_, &colourGradients_}) *three = device.array<float>(3 * rays);
  opacityGradients_ = device.array<float>(rays);
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
  const double perRay = 1.0 / rays_;
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
  photoRays_.draw(step, rays_);
  const VolumeRays rays{rays_,
                        photoRays_.origins(0, rays_),
                        photoRays_.directions(0, rays_),
                        photoRays_.jitters(),
                        photoRays_.fars(0, rays_),
                        photoRays_.nears(0, rays_)};
  pass_.forward(rays, options);
  return rays;
}

// Where rays want more texels than there is room for, what has none is fog: then again with fewer rays.
bool VolumeTrainer::drawsFewerRays(uint32_t texelsWanted) {
  constexpr double kFewer = 0.9;  // texels grow more slowly than rays
  const double room = pass_.roomForTexels(), wanted = texelsWanted;
  if (wanted <= room || rays_ == kGroup) return false;
  rays_ = std::max(1u, static_cast<uint32_t>(kFewer * room / wanted * rays_ / kGroup)) * kGroup;
  return true;
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
    addColourGradients(step);
    pass_.backward(rays, colourGradients_, opacityGradients_, lossScales(step, plannedSteps));
    updateParameters(step, plannedSteps, options);
    // The step is over: its counters may be read. Where it had no room, it has changed nothing.
    std::tie(losses, inner, texels, samples) =
        device_.readTogether(losses_.all(), pass_.losses(), pass_.texelsWanted(), pass_.firstSample().part(rays_, 1));
  } while (drawsFewerRays(texels[0]));
  exposures_.settle(step, config_.exposure);

  for (const uint32_t block : model_.blockOfSlot()) asSaved_[block] = false;

  StepReport report;
  report.rays = rays_;
  report.samples = samples[0];
  report.marched = rays_ * static_cast<uint32_t>(config_.firstIntervals + config_.secondIntervals);
  report.loss = losses[0] + losses[2];
  for (const float loss : inner) report.loss += loss;
  double weight = 0;
  for (const float w : photoRays_.batch().weights) weight += w;
  report.squaredError = losses[1] / std::max(1.0, 3 * weight);
  report.texels = std::max(1u, texels[0]);

  // Texels grow more slowly than rays, so half of the way is enough.
  const double wanted = rays_ * std::sqrt(static_cast<double>(config_.texelsPerStep) / report.texels);
  rays_ = static_cast<uint32_t>(std::clamp<double>(std::floor(wanted / kGroup), 1, config_.mostRays / kGroup)) * kGroup;
  return report;
}

void VolumeTrainer::addColourGradients(int64_t step) {
  const Count rays{rays_};
  const Slice<const uint32_t> photoOfRay = photoRays_.photoOfRay(0, rays_);
  const Slice<const float> backgrounds = photoRays_.backgrounds(0, rays_);
  device_.run(
      ExposureForward{rays, pass_.colour(), pass_.opacity(), backgrounds, photoOfRay, exposures_.logGains(), exposed_});
  ColourLoss loss;
  loss.kind = colourLossKind(config_.loss);
  loss.parameter = static_cast<float>(config_.lossParameter);
  loss.scale = 1.0f / (3.0f * static_cast<float>(rays_));
  loss.rays = rays;
  loss.predicted = exposed_;
  loss.target = photoRays_.targets(0, rays_);
  loss.weights = photoRays_.weights(0, rays_);
  loss.loss = losses_.part(0, 2);
  loss.gradients = colourGradients_;
  device_.run(loss);
  if (config_.s3im > 0) {
    S3imLoss similarity;
    similarity.scale = static_cast<float>(config_.s3im);
    similarity.rays = rays;
    similarity.seed = mix64(static_cast<uint64_t>(config_.seed) + static_cast<uint64_t>(step));
    similarity.predicted = exposed_;
    similarity.target = loss.target;
    similarity.weights = loss.weights;
    similarity.loss = losses_.part(2, 1);
    similarity.gradients = colourGradients_;
    device_.run(similarity);
  }
  device_.run(ExposureBackward{rays, pass_.colour(), backgrounds, photoOfRay, exposures_.logGains(), colourGradients_,
                               colourGradients_, opacityGradients_, exposures_.gradients()});
}

void VolumeTrainer::updateParameters(int64_t step, int64_t plannedSteps, const VolumePass::Options& kept) {
  RateSchedule schedule;
  schedule.rate = config_.rate;
  schedule.finalFactor = config_.finalRateFactor;
  schedule.constantFraction = config_.constantRateShare;
  const float rate = static_cast<float>(schedule.at(step, plannedSteps));
  const float ofFields = config_.level > 0 ? rate * static_cast<float>(config_.levelRateFactor) : rate;
  Adam all;
  if (rays_ > kGroup) all.found = pass_.texelsWanted();
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
  exposures_.step(ofExposures, config_.exposure);
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
    exposures_.save(tensors);
    tensors.add("rays", std::vector<uint32_t>{rays_});
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
  if (!model_.deferred().allFinite(device_) || !exposures_.allFinite()) return 0;
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
    if (block == 0) exposures_.restore(path, state);
  }
}

void VolumeTrainer::restore(uint32_t part, const fs::path& path, const Safetensors& state) {
  requireFormat(path, state, kFormat, "volume");
  restoreBlock(part, path, state);
  asSaved_[part] = true;
  if (part != 0) return;
  model_.restoreDeferred(path, state);
  warnOfOtherDevice(path, state, device_.target());
  exposures_.restore(path, state);
  const TensorView& rays = state.require(path, "rays", TensorType::u32);
  if (rays.elements() != 1) throw Error(path.string(), "tensor rays", "is not one number", "train again");
  const uint32_t groups = rays.as<uint32_t>()[0] / kGroup;
  rays_ = std::clamp(groups, 1u, static_cast<uint32_t>(config_.mostRays) / kGroup) * kGroup;
}

}  // namespace tessera
