#include "representations/volume/train_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "train/known_distances.h"
#include "train/level_folders.h"

namespace tessera {
namespace {

constexpr double kMiB = 1048576;
// Of the memory that is planned for: for blocks in training, and for decoded photos. The rest is for what a step works
// on.
constexpr double kShareOfBlocks = 0.4, kShareOfPhotos = 0.4;
constexpr double kHeap = 1.02;         // what the C library keeps besides (1.002 was measured)
constexpr double kWorthSaying = 0.02;  // of the pixels are not trained on
constexpr double kMostPixelsOff = 2;   // of observations whose distance is believed
constexpr const char* kWaiting = "waiting";

double plannedMemory(const TrainVolumeOptions& options) {
  return options.memoryMiB > 0 ? options.memoryMiB * kMiB : static_cast<double>(usableMemoryBytes());
}

BlockLimits limitsOf(const TrainVolumeOptions& options) {
  BlockLimits limits;
  limits.texelsPerEdge = options.config.planes;
  limits.bytesPerBlock = trainingBytesPerBlock(options.config);
  limits.memoryBudget = kShareOfBlocks * plannedMemory(options);
  const int resident = options.config.residentBlocks;
  if (resident == 0) return limits;
  const double bytes = resident * limits.bytesPerBlock;
  if (bytes > limits.memoryBudget) {
    warn(
        "{} blocks in memory at a time take {:.0f} MiB, more than the {:.0f} that are meant for them; lower "
        "--resident-blocks",
        resident, bytes / kMiB, limits.memoryBudget / kMiB);
  }
  limits.memoryBudget = std::numeric_limits<double>::infinity();  // however many there are
  return limits;
}

PartitionOptions partitioningFor(const Capture& capture, const TrainVolumeOptions& options) {
  PartitionOptions partitioning;
  partitioning.blocks = options.blocks;
  partitioning.grid = options.grid;
  partitioning.limits = limitsOf(options);
  partitioning.enough.pixels = int64_t{options.config.planes} * options.config.planes / 16;
  partitioning.depthOf = KnownDepths(capture, kMostPixelsOff);
  return partitioning;
}

}  // namespace

double trainingBytesPerBlock(const VolumeConfig& config) {
  constexpr double kPerParameter = 5 * sizeof(float);  // values, gradients, two moments, counts
  const BlockFieldShape attributes = config.attributeShape(), proposals = config.proposalShape();
  const size_t parameters = attributes.grid.parameters() + attributes.network.parameters() +
                            proposals.grid.parameters() + proposals.network.parameters();
  return kPerParameter * static_cast<double>(parameters) + 2.0 * sizeof(uint32_t) * config.virtualGrid().words();
}

VolumeConfig levelConfig(VolumeConfig finest, uint32_t level, int64_t finestStep) {
  finest.level = static_cast<int>(level);
  finest.finestStep = finestStep;
  finest.voxels = std::max(8, (finest.voxels >> level) / 8 * 8);
  finest.planes = std::max(8, (finest.planes >> level) / 8 * 8);
  // Its proposals begin as the finest level's, which pass over the fog that large texels make around surfaces.
  finest.padding = std::max(finest.padding, finest.levelPadding);
  return finest;
}

namespace {

// With all that is allocated by now: what training adds are decoded photos, and a checkpoint of one block, twice.
void sayWhatMemoryItTakes(VolumeTrainer& trainer, const Capture& capture, const TrainVolumeOptions& options) {
  const VolumeConfig& config = options.config;
  const double all = static_cast<double>(decodedBytes(capture, capture.photosIn(Split::train)));
  const double photos = config.photoBudgetMiB > 0 ? std::min(all, config.photoBudgetMiB * kMiB) : all;
  const double bytes = kHeap * (static_cast<double>(residentBytes()) + photos + 2 * trainingBytesPerBlock(config));
  const Residency* residency = trainer.residency();
  inform("memory: at most {:.0f} MiB{}", bytes / kMiB,
         residency ? fmt::format(", with {} of {} blocks at a time, {} stays in {} steps", config.residentBlocks,
                                 trainer.model().space().cells(), residency->stays().size(), residency->cycleSteps())
                   : "");
  if (bytes > plannedMemory(options)) {
    warn(
        "that is more than the {:.0f} MiB there are; use --resident-blocks, or lower texels_per_step or "
        "photo_budget_mib",
        plannedMemory(options) / kMiB);
  }
  if (!residency) return;
  const std::vector<uint32_t> never = residency->neverServed();
  if (!never.empty()) {
    const uint32_t columns = trainer.model().space().columns;
    std::vector<std::string> names;
    for (const uint32_t block : never) names.push_back(fmt::format("({}, {})", block % columns, block / columns));
    warn(
        "blocks {} are seen through more than {} blocks at a time wherever they are seen, and will hold nothing; raise "
        "--resident-blocks",
        fmt::join(names, ", "), config.residentBlocks);
  }
  if (residency->unserved() < kWorthSaying) return;
  warn(
      "{:.0f} % of what the photos show is seen through more than {} blocks, or rare sets of them, and not trained on; "
      "raise --resident-blocks",
      100 * residency->unserved(), config.residentBlocks);
}

void warnWhereBlocksMissTheirTurn(const VolumeTrainer& trainer, int64_t steps) {
  const int64_t cycle = trainer.residency() ? trainer.residency()->cycleSteps() : 0;
  if (steps >= cycle) return;
  warn(
      "all blocks get their turn in {} steps, and there are {}: some are trained too little, or not at all; train for "
      "longer, raise --resident-blocks, or lower residency_steps",
      cycle, steps);
}

// What all levels are trained on.
struct Training {
  Device& device;
  const Capture& capture;
  const BlockGrid& grid;
};

// Writes what a run is made of, unless a run is there already.
void writeRun(const ModelFolder& folder, const Training& on, VolumeConfig config, const TrainingLoopOptions& loop) {
  if (folder.manifest()) return;
  writeFileAtomically(folder.configPath(),
                      howToRepeat(on.device, loop, " --grid blocks.json") + configToToml(config.fields()));
  folder.writePlacement({{}, on.grid, on.capture.sourceFromWorld, on.capture.root, trainingNames(on.capture)},
                        loop.method);
}

// `loop.steps` of the level that `config` is for, or those that it had planned when it was begun. True when it is
// trained to its end.
bool trainLevel(const fs::path& model, const Training& on, VolumeConfig config, TrainingLoopOptions loop) {
  const uint32_t level = static_cast<uint32_t>(config.level);
  const ModelFolder folder(levelFolder(model, level));
  if (folder.manifest() && savedConfig<VolumeConfig>(folder.root()).finestStep != config.finestStep) {
    removeLevel(folder.root());
  }
  const std::optional<ModelManifest> before = folder.manifest();
  if (before && before->step >= before->plannedSteps) return true;
  loop.minutes = 0;
  if (before) loop.steps = before->plannedSteps;
  config.residencySteps = std::min(config.residencySteps, loop.steps);  // all blocks get their turn
  VolumeTrainer trainer(on.device, on.capture, config, on.grid, folder.root() / kWaiting);
  if (!before) trainer.beginFrom(levelFolder(model, level - 1));
  loop.resume = true;
  writeRun(folder, on, config, loop);
  inform("level {}: {} blocks in {} models, {} steps", level, on.grid.cells(), trainer.model().groups().cells.size(),
         loop.steps);
  return runTraining(trainer, folder, loop).finished;
}

}  // namespace

TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options) {
  options.config.check();
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  options.loop.method = "volume";
  refuseTrainedModel(folder, options.loop);
  const bool goingOn = folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  VolumeConfig& config = options.config;
  config.photoBudgetMiB = settledPhotoBudget(config.photoBudgetMiB, capture,
                                             static_cast<int64_t>(2 * kShareOfPhotos * plannedMemory(options)));
  // A resumed run stands where the killed one stood, whatever has become of the capture's points since.
  const BlockGrid grid = goingOn ? requireGrid(folder) : cutBlocks(capture, model, partitioningFor(capture, options));
  if (goingOn) requireSameBlocks(model / "blocks.json", grid, options.blocks, options.grid);
  const Training on{device, capture, grid};
  TrainingResult result;
  {
    VolumeTrainer trainer(device, capture, config, grid, folder.root() / kWaiting);
    if (!goingOn) fs::remove_all(model / "levels");  // of a run that is no more
    writeRun(folder, on, config, options.loop);
    sayWhatMemoryItTakes(trainer, capture, options);
    const bool stepsAreKnown = options.loop.steps > 0 && !goingOn;  // else they are settled on the way
    if (stepsAreKnown) warnWhereBlocksMissTheirTurn(trainer, options.loop.steps);
    result = runTraining(trainer, folder, options.loop);
    if (!stepsAreKnown && result.finished) warnWhereBlocksMissTheirTurn(trainer, result.plannedSteps);
  }
  const uint32_t top = topLevel(static_cast<uint32_t>(grid.columns), static_cast<uint32_t>(grid.rows));
  for (uint32_t level = 1; level <= top && result.finished; ++level) {
    options.loop.steps = levelSteps(config.levelShare, level, result.plannedSteps);
    if (options.loop.steps < 1) break;
    result.finished = trainLevel(model, on, levelConfig(config, level, result.step), options.loop);
  }
  return result;
}

std::unique_ptr<VolumeModel> loadVolumeModel(Device& device, const fs::path& folder, uint32_t residentBlocks) {
  const ModelFolder model(folder);
  const ModelManifest manifest = requireManifest(model, "volume");
  VolumeConfig config;
  configFromToml(config.fields(), model.configPath());
  auto made =
      std::make_unique<VolumeModel>(device, config, requireGrid(model), VolumeModel::Room{residentBlocks, false});
  requireOneFileABlock(folder, manifest, made->space().blocks());
  std::vector<fs::path> files;
  for (const std::string& file : manifest.files) files.push_back(folder / file);
  made->readFrom(std::move(files));
  return made;
}

}  // namespace tessera
