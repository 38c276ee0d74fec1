#include "representations/hash/train_hash.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bake/levels.h"
#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "tiles/hash_payload.h"
#include "train/known_distances.h"
#include "train/level_folders.h"

namespace tessera {
namespace {

constexpr double kMiB = 1048576;
// Of the memory that is planned for: for blocks, and for decoded photos. The rest is for what a step works on.
constexpr double kShareOfBlocks = 0.4, kShareOfPhotos = 0.4;
constexpr double kMostPixelsOff = 2;  // of observations whose distance is believed

double plannedMemory(const TrainHashOptions& options) {
  return options.memoryMiB > 0 ? options.memoryMiB * kMiB : static_cast<double>(usableMemoryBytes());
}

PartitionOptions partitioningFor(const Capture& capture, const TrainHashOptions& options) {
  PartitionOptions partitioning;
  partitioning.blocks = options.blocks;
  partitioning.grid = options.grid;
  partitioning.limits.texelsPerEdge = options.config.lattice << options.config.levels;
  partitioning.limits.bytesPerBlock = trainingBytesPerBlock(options.config);
  partitioning.limits.memoryBudget = kShareOfBlocks * plannedMemory(options);
  partitioning.enough.pixels = int64_t{options.config.lattice} * options.config.lattice;
  partitioning.depthOf = KnownDepths(capture, kMostPixelsOff);
  return partitioning;
}

}  // namespace

double trainingBytesPerBlock(const HashConfig& config) {
  constexpr double kPerParameter = 5 * sizeof(float);  // values, gradients, two moments, counts
  const BlockFieldShape coarse = config.coarseShape();
  const size_t parameters = coarse.grid.parameters() + coarse.network.parameters() + config.fineGrid().parameters();
  const double cells = std::pow(config.occupancyResolution, 3);
  return kPerParameter * static_cast<double>(parameters) + 2.0 * sizeof(uint32_t) * config.latticeGrid().words() +
         cells * (sizeof(float) + sizeof(uint32_t));
}

HashConfig levelConfig(HashConfig finest, uint32_t level, int64_t finestStep) {
  const int by = static_cast<int>(level);
  finest.level = by;
  finest.finestStep = finestStep;
  finest.lattice = std::max(8, (finest.lattice >> by) / 8 * 8);
  finest.coarseBase = std::min(finest.coarseBase, finest.lattice);
  finest.levels = std::max(1, finest.levels - by);
  finest.fineLog2Size = std::min(finest.fineLog2Size, std::max(8, finest.fineLog2Size - 2 * by));
  finest.occupancyResolution =
      std::min(finest.occupancyResolution, std::max(16, (finest.occupancyResolution >> by) / 4 * 4));
  return finest;
}

namespace {

// Throws Error where a level could not be baked, before anything is trained.
void requireStepsOfScenes(const HashConfig& config) {
  const double longest = config.longestStep(), shortest = config.shortestStep * longest;
  if (longest <= kLongestHashStep && shortest >= kShortestHashStep) return;
  throw Error(fmt::format("--set step={}", config.step), "",
              fmt::format("at level {}, with {} corners along an edge, rays take steps of {:.3g} to {:.3g} of a block, "
                          "where scenes have {:.3g} to {:.3g}",
                          config.level, config.lattice, shortest, longest, kShortestHashStep, kLongestHashStep),
              "use another one, or level_share=0");
}

// What all levels are trained on.
struct Training {
  Device& device;
  const Capture& capture;
  const BlockGrid& grid;
};

TrainingResult trainLevel(const ModelFolder& folder, const Training& on, HashConfig config,
                          const TrainingLoopOptions& loop) {
  HashTrainer trainer(on.device, on.capture, config, on.grid);
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(),
                        howToRepeat(on.device, loop, " --grid blocks.json") + configToToml(config.fields()));
    folder.writePlacement({{}, on.grid, on.capture.sourceFromWorld, on.capture.root, trainingNames(on.capture)},
                          loop.method);
  }
  return runTraining(trainer, folder, loop);
}

// `loop.steps` of the level that `config` is for, or those that it had planned when it was begun. True when it is
// trained to its end.
bool trainCoarserLevel(const fs::path& model, const Training& on, const HashConfig& config, TrainingLoopOptions loop) {
  const uint32_t level = static_cast<uint32_t>(config.level);
  const ModelFolder folder(levelFolder(model, level));
  if (folder.manifest() && savedConfig<HashConfig>(folder.root()).finestStep != config.finestStep) {
    removeLevel(folder.root());
  }
  if (const std::optional<ModelManifest> before = folder.manifest()) {
    if (before->step >= before->plannedSteps) return true;
    loop.steps = before->plannedSteps;
  }
  const LevelGroups groups =
      groupsOfLevel(static_cast<uint32_t>(on.grid.columns), static_cast<uint32_t>(on.grid.rows), level, false);
  inform("level {}: {} blocks in {} tiles, {} steps", level, on.grid.cells(), groups.cells.size(), loop.steps);
  return trainLevel(folder, on, config, loop).finished;
}

}  // namespace

TrainingResult trainHash(Device& device, const Capture& capture, const fs::path& model, TrainHashOptions options) {
  options.config.check();
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  options.loop.method = "hash";
  refuseTrainedModel(folder, options.loop);
  const bool goingOn = folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  HashConfig& config = options.config;
  config.photoBudgetMiB = settledPhotoBudget(config.photoBudgetMiB, capture,
                                             static_cast<int64_t>(2 * kShareOfPhotos * plannedMemory(options)));
  // A resumed run stands where the killed one stood, whatever has become of the capture's points since.
  const BlockGrid grid = goingOn ? requireGrid(folder) : cutBlocks(capture, model, partitioningFor(capture, options));
  if (goingOn) requireSameBlocks(model / "blocks.json", grid, options.blocks, options.grid);
  const uint32_t top =
      config.levelShare > 0 ? topLevel(static_cast<uint32_t>(grid.columns), static_cast<uint32_t>(grid.rows)) : 0;
  for (uint32_t level = 0; level <= top; ++level) requireStepsOfScenes(levelConfig(config, level, 0));
  if (!goingOn) fs::remove_all(model / "levels");  // of a run that is no more
  TrainingResult result = trainLevel(folder, {device, capture, grid}, config, options.loop);
  for (uint32_t level = 1; level <= top && result.finished; ++level) {
    TrainingLoopOptions loop = options.loop;
    loop.minutes = 0;
    loop.resume = true;
    loop.steps = levelSteps(config.levelShare, level, result.plannedSteps);
    if (loop.steps < 1) break;
    result.finished = trainCoarserLevel(model, {device, capture, grid}, levelConfig(config, level, result.step), loop);
  }
  return result;
}

}  // namespace tessera
