#include "representations/hash/train_hash.h"

#include <cmath>

#include "base/memory.h"
#include "train/known_distances.h"
#include "train/run_folder.h"

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
  HashTrainer trainer(device, capture, config, grid);
  if (!goingOn) {
    writeFileAtomically(folder.configPath(),
                        howToRepeat(device, options.loop, " --grid blocks.json") + configToToml(config.fields()));
    folder.writePlacement({{}, grid, capture.sourceFromWorld, capture.root, trainingNames(capture)},
                          options.loop.method);
  }
  return runTraining(trainer, folder, options.loop);
}

}  // namespace tessera
