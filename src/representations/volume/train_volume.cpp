#include "representations/volume/train_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/log.h"

namespace tessera {
namespace {

constexpr double kMiB = 1048576;
constexpr double kWorthSaying = 0.02;  // of the pixels are not trained on
constexpr const char* kWaiting = "waiting";

BlockLimits limitsOf(const TrainVolumeOptions& options) {
  BlockLimits limits;
  limits.texelsPerEdge = options.config.planes;
  limits.bytesPerBlock = trainingBytesPerBlock(options.config);
  limits.memoryBudget = options.bytesForBlocks();
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

void sayWhatThereIsMemoryFor(VolumeTrainer& trainer, const BlockTraining& on, const TrainVolumeOptions& options) {
  const VolumeConfig& config = options.config;
  const Residency* residency = trainer.residency();
  MemoryNeeds needs;
  needs.photoBudgetMiB = config.photoBudgetMiB;
  needs.bytesPerBlock = trainingBytesPerBlock(config);
  needs.remedy = "use --resident-blocks, or lower texels_per_step or photo_budget_mib";
  if (residency) {
    needs.how = fmt::format(", with {} of {} blocks at a time, {} stays in {} steps", config.residentBlocks,
                            trainer.model().space().cells(), residency->stays().size(), residency->cycleSteps());
  }
  sayWhatMemoryItTakes(on, options, needs);
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

// True when it is trained to its end.
bool trainLevel(const fs::path& model, const BlockTraining& on, const ModelFolder& folder, VolumeConfig config,
                const TrainingLoopOptions& loop) {
  const uint32_t level = static_cast<uint32_t>(config.level);
  config.residencySteps = std::min(config.residencySteps, loop.steps);  // all blocks get their turn
  VolumeTrainer trainer(on.device, on.capture, config, on.grid, folder.root() / kWaiting);
  if (!folder.manifest()) trainer.beginFrom(levelFolder(model, level - 1));
  writeRun(folder, on, config.fields(), loop);
  inform("level {}: {} blocks in {} models, {} steps", level, on.grid.cells(), trainer.model().groups().cells.size(),
         loop.steps);
  return runTraining(trainer, folder, loop).finished;
}

}  // namespace

TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options) {
  VolumeConfig& config = options.config;
  config.check();
  options.loop.method = "volume";
  const BlockRun run = openBlockRun(capture, model, options,
                                    {[&] { return limitsOf(options); },
                                     {kEnoughPhotos, int64_t{config.planes} * config.planes / 16},
                                     config.photoBudgetMiB});
  config.photoBudgetMiB = run.photoBudgetMiB;
  const BlockTraining on{device, capture, run.grid};
  TrainingResult result;
  {
    VolumeTrainer trainer(device, capture, config, run.grid, run.folder.root() / kWaiting);
    if (!run.goesOn) fs::remove_all(model / "levels");  // of a run that is no more
    writeRun(run.folder, on, config.fields(), options.loop);
    sayWhatThereIsMemoryFor(trainer, on, options);
    const bool stepsAreKnown = options.loop.steps > 0 && !run.goesOn;  // else they are settled on the way
    if (stepsAreKnown) warnWhereBlocksMissTheirTurn(trainer, options.loop.steps);
    result = runTraining(trainer, run.folder, options.loop);
    if (!stepsAreKnown && result.finished) warnWhereBlocksMissTheirTurn(trainer, result.plannedSteps);
  }
  if (!result.finished) return result;
  LevelTraining levels;
  levels.madeFrom = [](const fs::path& folder) { return savedConfig<VolumeConfig>(folder).finestStep; };
  levels.train = [&](const ModelFolder& folder, uint32_t level, const TrainingLoopOptions& loop) {
    return trainLevel(model, on, folder, levelConfig(config, level, result.step), loop);
  };
  const uint32_t top = topLevel(static_cast<uint32_t>(run.grid.columns), static_cast<uint32_t>(run.grid.rows));
  result.finished = trainCoarserLevels(model, top, config.levelShare, result, options.loop, levels);
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
