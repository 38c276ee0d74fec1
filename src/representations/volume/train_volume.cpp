#include "representations/volume/train_volume.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "partition/block_map.h"
#include "scene/block_grid_json.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

constexpr double kMemoryShare = 0.5;   // of the machine's, for blocks in training
constexpr double kWorthSaying = 0.02;  // of the pixels are not trained on
constexpr const char* kWaiting = "waiting";

// Cuts the capture, draws the map, and says what people should know before hours of training.
BlockGrid cut(const Capture& capture, const fs::path& model, const TrainVolumeOptions& options) {
  PartitionOptions partitioning;
  partitioning.blocks = options.blocks;
  partitioning.grid = options.grid;
  partitioning.limits.texelsPerEdge = options.config.planes;
  partitioning.limits.bytesPerBlock = trainingBytesPerBlock(options.config);
  partitioning.limits.memoryBudget = kMemoryShare * static_cast<double>(usableMemoryBytes());
  partitioning.enough.pixels = int64_t{options.config.planes} * options.config.planes / 16;
  const Partition partition = partitionCapture(capture, partitioning);
  for (const std::string& note : partition.notes) inform("{}", note);
  for (const ThinCell& thin : partition.thin) warn("{}", thin.warning);
  writeBlockMap(model, capture, partition);
  return partition.grid;
}

}  // namespace

double trainingBytesPerBlock(const VolumeConfig& config) {
  constexpr double kPerParameter = 5 * sizeof(float);  // values, gradients, two moments, counts
  const BlockFieldShape attributes = config.attributeShape(), proposals = config.proposalShape();
  const size_t parameters = attributes.grid.parameters() + attributes.network.parameters() +
                            proposals.grid.parameters() + proposals.network.parameters();
  return kPerParameter * static_cast<double>(parameters) + 2.0 * sizeof(uint32_t) * config.virtualGrid().words();
}

fs::path levelFolder(const fs::path& model, uint32_t level) {
  return level == 0 ? model : model / "levels" / std::to_string(level);
}

uint32_t trainedLevels(const fs::path& model) {
  for (uint32_t levels = 1;; ++levels) {
    const std::optional<ModelManifest> next = ModelFolder(levelFolder(model, levels)).manifest();
    if (!next || next->step < next->plannedSteps) return levels;
  }
}

VolumeConfig levelConfig(VolumeConfig finest, uint32_t level) {
  finest.level = static_cast<int>(level);
  finest.voxels = std::max(8, (finest.voxels >> level) / 8 * 8);
  finest.planes = std::max(8, (finest.planes >> level) / 8 * 8);
  // Its proposals begin as the finest level's, which pass over the fog that large texels make around surfaces.
  finest.padding = std::max(finest.padding, finest.levelPadding);
  return finest;
}

namespace {

// With all that is allocated by now: what training adds are decoded photos, and a checkpoint of one block, twice.
void sayWhatMemoryItTakes(VolumeTrainer& trainer, const Capture& capture, const VolumeConfig& config) {
  constexpr double kMiB = 1048576;
  const Residency* residency = trainer.residency();
  if (!residency) return;
  const double all = static_cast<double>(decodedBytes(capture, capture.photosIn(Split::train)));
  const double photos = config.photoBudgetMiB > 0 ? std::min(all, config.photoBudgetMiB * kMiB) : all;
  const double bytes = static_cast<double>(residentBytes()) + photos + 2 * trainingBytesPerBlock(config);
  inform("memory: at most {:.0f} MiB, with {} of {} blocks at a time, {} stays in {} steps", bytes / kMiB,
         config.residentBlocks, trainer.model().space().cells(), residency->stays().size(), residency->cycleSteps());
  if (residency->unserved() < kWorthSaying) return;
  warn(
      "{:.0f} % of what the photos show is seen through more than {} blocks, or rare sets of them, and not trained on; "
      "raise --resident-blocks",
      100 * residency->unserved(), config.residentBlocks);
}

// Writes what a run is made of, unless a run is there already.
void writeRun(Device& device, const ModelFolder& folder, const Capture& capture, const BlockGrid& grid,
              VolumeConfig config, const TrainingLoopOptions& loop) {
  if (folder.manifest()) return;
  writeFileAtomically(folder.configPath(),
                      howToRepeat(device, loop, " --grid blocks.json") + configToToml(config.fields()));
  folder.writePlacement({{}, grid, capture.sourceFromWorld, capture.root, trainingNames(capture)}, loop.method);
}

// True when the level is trained to its end. A level that was begun goes on with the steps that it had planned.
bool trainLevel(Device& device, const Capture& capture, const fs::path& model, uint32_t level, const BlockGrid& grid,
                const VolumeConfig& finest, TrainingLoopOptions loop, int64_t steps) {
  const ModelFolder folder(levelFolder(model, level));
  const std::optional<ModelManifest> before = folder.manifest();
  if (before && before->step >= before->plannedSteps) return true;
  const VolumeConfig config = levelConfig(finest, level);
  VolumeTrainer trainer(device, capture, config, grid, folder.root() / kWaiting);
  if (!before) trainer.beginFrom(levelFolder(model, level - 1));
  loop.minutes = 0;
  loop.steps = before ? before->plannedSteps : steps;
  loop.resume = true;
  writeRun(device, folder, capture, grid, config, loop);
  inform("level {}: {} blocks in {} models, {} steps", level, grid.cells(), trainer.model().groups().cells.size(),
         loop.steps);
  return runTraining(trainer, folder, loop).finished;
}

void requireSameGrid(const ModelFolder& folder, const BlockGrid& has, const BlockGrid& wanted) {
  if (blockGridToJson(has) == blockGridToJson(wanted)) return;
  throw Error((folder.root() / "blocks.json").string(), "grid", "the run has other blocks than those of --grid",
              "resume without --grid, or train into another folder");
}

}  // namespace

TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options) {
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  options.loop.method = "volume";
  const bool goingOn = options.loop.resume && folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  options.config.photoBudgetMiB = settledPhotoBudget(options.config.photoBudgetMiB, capture, usableMemoryBytes());
  // A resumed run stands where the killed one stood, whatever has become of the capture's points since.
  const BlockGrid grid = goingOn ? requireGrid(folder) : cut(capture, model, options);
  if (options.grid) requireSameGrid(folder, grid, *options.grid);
  TrainingResult result;
  {
    VolumeTrainer trainer(device, capture, options.config, grid, folder.root() / kWaiting);
    if (!goingOn && !folder.manifest()) fs::remove_all(model / "levels");  // of a run that is no more
    writeRun(device, folder, capture, grid, options.config, options.loop);
    sayWhatMemoryItTakes(trainer, capture, options.config);
    result = runTraining(trainer, folder, options.loop);
  }
  const int64_t steps = static_cast<int64_t>(options.config.levelShare * static_cast<double>(result.plannedSteps));
  if (!result.finished || steps < 1) return result;
  const uint32_t top = topLevel(static_cast<uint32_t>(grid.columns), static_cast<uint32_t>(grid.rows));
  for (uint32_t level = 1; level <= top && result.finished; ++level) {
    result.finished = trainLevel(device, capture, model, level, grid, options.config, options.loop, steps);
  }
  return result;
}

BlockGrid requireGrid(const ModelFolder& folder) {
  const std::optional<BlockGrid> grid = folder.readPlacement().grid;
  if (grid) return *grid;
  throw Error((folder.root() / "blocks.json").string(), "grid", "there is none", "restore the file or train again");
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
