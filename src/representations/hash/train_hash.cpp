#include "representations/hash/train_hash.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "bake/levels.h"
#include "base/error.h"
#include "base/log.h"
#include "representations/hash/find_distortion.h"
#include "tiles/hash_payload.h"

namespace tessera {

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

BlockLimits limitsOf(const TrainHashOptions& options) {
  BlockLimits limits;
  limits.texelsPerEdge = options.config.lattice << options.config.levels;
  limits.bytesPerBlock = trainingBytesPerBlock(options.config);
  limits.memoryBudget = options.bytesForBlocks();
  return limits;
}

void sayMemory(const BlockTraining& on, const TrainHashOptions& options) {
  const HashConfig& config = options.config;
  sayWhatMemoryItTakes(on, options,
                       {config.photoBudgetMiB, trainingBytesPerBlock(config), "",
                        "lower samples_per_step, texels_per_step or photo_budget_mib, or use --method volume with "
                        "--resident-blocks"});
}

TrainingResult trainLevel(const ModelFolder& folder, const BlockTraining& on, HashConfig config,
                          const TrainingLoopOptions& loop, const std::function<void()>& begun) {
  HashTrainer trainer(on.device, on.capture, config, on.grid);
  writeRun(folder, on, config.fields(), loop);
  begun();
  return runTraining(trainer, folder, loop);
}

}  // namespace

TrainingResult trainHash(Device& device, const Capture& capture, const fs::path& model, TrainHashOptions options) {
  HashConfig& config = options.config;
  if (options.loop.resume && ModelFolder(model).manifest()) config.keepFound(savedConfig<HashConfig>(model));
  config.check();
  options.loop.method = "hash";
  const BlockRun run = openBlockRun(capture, model, options,
                                    {[&] { return limitsOf(options); },
                                     {kEnoughPhotos, int64_t{config.lattice} * config.lattice},
                                     config.photoBudgetMiB});
  config.photoBudgetMiB = run.photoBudgetMiB;
  const uint32_t top = config.levelShare > 0
                           ? topLevel(static_cast<uint32_t>(run.grid.columns), static_cast<uint32_t>(run.grid.rows))
                           : 0;
  for (uint32_t level = 0; level <= top; ++level) requireStepsOfScenes(levelConfig(config, level, 0));
  const BlockTraining on{device, capture, run.grid};
  if (!run.goesOn) fs::remove_all(model / "levels");  // of a run that is no more
  bool memoryIsSaid = false;
  const auto sayMemoryOnce = [&] {
    if (!std::exchange(memoryIsSaid, true)) sayMemory(on, options);
  };
  if (!config.distortion) {
    if (!options.loop.resume) fs::remove(distortionFile(model));
    if (!findDistortion(on, model, config, options.loop, sayMemoryOnce)) return {};
  } else if (!run.goesOn) {
    fs::remove(distortionFile(model));  // of another run
  }
  TrainingResult result = trainLevel(run.folder, on, config, options.loop, sayMemoryOnce);
  if (!result.finished) return result;
  LevelTraining levels;
  levels.madeFrom = [](const fs::path& folder) { return savedConfig<HashConfig>(folder).finestStep; };
  levels.train = [&](const ModelFolder& folder, uint32_t level, const TrainingLoopOptions& loop) {
    const LevelGroups groups =
        groupsOfLevel(static_cast<uint32_t>(run.grid.columns), static_cast<uint32_t>(run.grid.rows), level, false);
    inform("level {}: {} blocks in {} tiles, {} steps", level, run.grid.cells(), groups.cells.size(), loop.steps);
    return trainLevel(folder, on, levelConfig(config, level, result.step), loop, [] {}).finished;
  };
  result.finished = trainCoarserLevels(model, top, config.levelShare, result, options.loop, levels);
  return result;
}

}  // namespace tessera
