#include "representations/volume/train_volume.h"

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "partition/block_map.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

constexpr double kMemoryShare = 0.5;  // of the machine's, for blocks in training

// Cuts the capture, draws the map, and says what people should know before hours of training.
BlockGrid cut(const Capture& capture, const fs::path& model, const TrainVolumeOptions& options) {
  PartitionOptions partitioning;
  partitioning.blocks = options.blocks;
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

TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options) {
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  options.loop.method = "volume";
  const bool goingOn = options.loop.resume && folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  options.config.photoBudgetMiB = settledPhotoBudget(options.config.photoBudgetMiB, capture, usableMemoryBytes());
  // A resumed run stands where the killed one stood, whatever has become of the capture's points since.
  const BlockGrid grid = goingOn ? requireGrid(folder) : cut(capture, model, options);
  VolumeTrainer trainer(device, capture, options.config, grid);
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(), howToRepeat(device, options.loop) + configToToml(options.config.fields()));
    folder.writePlacement({{}, grid, capture.sourceFromWorld, capture.root, trainingNames(capture)},
                          options.loop.method);
  }
  return runTraining(trainer, folder, options.loop);
}

BlockGrid requireGrid(const ModelFolder& folder) {
  const std::optional<BlockGrid> grid = folder.readPlacement().grid;
  if (grid) return *grid;
  throw Error((folder.root() / "blocks.json").string(), "grid", "there is none", "restore the file or train again");
}

std::unique_ptr<VolumeModel> loadVolumeModel(Device& device, const fs::path& folder) {
  const ModelFolder model(folder);
  const ModelManifest manifest = requireManifest(model, "volume");
  VolumeConfig config;
  configFromToml(config.fields(), model.configPath());
  auto made = std::make_unique<VolumeModel>(device, config, requireGrid(model));
  if (manifest.files.size() != made->space().blocks()) {
    throw Error((folder / "manifest.json").string(), "files", "does not name one checkpoint a block",
                "restore the file or train again");
  }
  for (uint32_t block = 0; block < made->space().blocks(); ++block) {
    const fs::path file = folder / manifest.files[block];
    made->restore(block, file, readSafetensors(file));
  }
  return made;
}

}  // namespace tessera
