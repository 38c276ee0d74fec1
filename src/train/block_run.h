// What training a capture in blocks has in common, whatever the blocks are (`volume`, `hash`): a run that is begun or
// gone on with, what memory it takes, and the coarser levels of detail after it.
#pragma once

#include <functional>
#include <optional>

#include "compute/device.h"
#include "partition/cut_blocks.h"
#include "train/level_folders.h"

namespace tessera {

struct BlockRunOptions {
  TrainingLoopOptions loop;
  BlockCount blocks;
  std::optional<BlockGrid> grid;  // of these blocks, whatever `blocks` says
  double memoryMiB = 0;           // to plan blocks and photos for; 0: what the machine has
  uint64_t cardBytes = 0;         // Device::ownMemory of the device that trains: blocks stand there

  double plannedBytes() const;
  double bytesForBlocks() const;  // of those, or of the card's; what photos leave is for what a step works on
  double bytesForPhotos() const;
};

// What a run asks of a capture.
struct BlockDemands {
  std::function<BlockLimits()> limits;  // asked only where the capture is cut
  Sufficiency enough;
  double photoBudgetMiB = 0;  // 0: what there is memory for, see settledPhotoBudget
};

struct BlockRun {
  ModelFolder folder;
  BlockGrid grid;
  bool goesOn;  // with the model that is in the folder
  double photoBudgetMiB;
};

// Cuts the capture into blocks, or takes those that are given; a run that goes on stands where it stood, whatever has
// become of the capture's points since. Throws Error when the folder holds a capture, or a model that is not to be gone
// on with, or one of other photos or blocks.
BlockRun openBlockRun(const Capture& capture, const fs::path& model, const BlockRunOptions& options,
                      const BlockDemands& demands);

// What all levels of a run are trained on.
struct BlockTraining {
  Device& device;
  const Capture& capture;
  const BlockGrid& grid;
};

// Writes what a level's run is made of (config.toml, blocks.json), unless there is a model already.
void writeRun(const ModelFolder& folder, const BlockTraining& on, const std::vector<ConfigField>& config,
              const TrainingLoopOptions& loop);

// Says how much memory training takes, with all allocated by now but decoded photos and checkpoints, and what else
// there is to say of it (`how`, as ", with 4 of 9 blocks at a time"); warns with a `remedy` where it is more than
// planned for.
struct MemoryNeeds {
  double photoBudgetMiB = 0;  // 0: all training photos
  double bytesPerBlock = 0;
  std::string how, remedy;
};
void sayWhatMemoryItTakes(const BlockTraining& on, const BlockRunOptions& options, const MemoryNeeds& needs);

// Levels 1 to `top`, after the finest, for as many steps as levelSteps says of `share`, or as they had planned when
// they were begun; those that were made before the finest came to where it is are made anew. False when one is not
// finished.
struct LevelTraining {
  // The finest level's step when the level in that folder was made.
  std::function<int64_t(const fs::path& folder)> madeFrom;
  // One level into its folder, which holds a model when it was begun before. False when it was asked to stop.
  std::function<bool(const ModelFolder& folder, uint32_t level, const TrainingLoopOptions& loop)> train;
};
bool trainCoarserLevels(const fs::path& model, uint32_t top, double share, const TrainingResult& finest,
                        TrainingLoopOptions loop, const LevelTraining& training);

}  // namespace tessera
