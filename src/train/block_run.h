// What training a capture in blocks has in common, whatever the blocks are: a run that is begun or gone on with, what
// memory it takes, and the coarser levels of detail after it.
#pragma once

#include <functional>
#include <memory>
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

// Says how much memory training takes, with all allocated by now but decoded photos and checkpoints, and what else
// there is to say of it (`how`, as ", with 4 of 9 blocks at a time"); warns with a `remedy` where it is more than
// planned for.
struct MemoryNeeds {
  double photoBudgetMiB = 0;  // 0: all training photos
  double bytesPerBlock = 0;
  std::string how, remedy;
};
void sayWhatMemoryItTakes(const BlockTraining& on, const BlockRunOptions& options, const MemoryNeeds& needs);

// A level of detail that is about to be trained, or to be gone on with where its folder holds a model.
struct BlockLevel {
  uint32_t level;      // 0 is the finest
  int64_t steps;       // to train in all; of the finest 0, where only the loop will know
  int64_t finestStep;  // of a coarser one: where the finest has come to
  ModelFolder folder, below;
};

// What a representation that is trained in blocks supplies to its training.
class BlockMethod {
 public:
  virtual ~BlockMethod() = default;

  virtual BlockDemands demands() const = 0;
  // Steps of the first coarser level, as a share of the finest's; 0: there are no coarser levels.
  virtual double levelShare() const = 0;
  // The coarsest level of so many blocks, one that holds all.
  virtual uint32_t topLevel(const BlockGrid& grid) const = 0;
  // The run is open, and takes a photo budget. Throws Error, before anything is trained, where a level up to `top`
  // could not be made.
  virtual void open(const BlockRun& run, uint32_t top) = 0;
  // Finds out what the settings leave to be found out, in a run that does not go on or has not got that far; `begun` is
  // to be called once most memory is allocated. False when it was asked to stop.
  virtual bool findSettings(const BlockTraining&, const BlockRun&, TrainingLoopOptions&,
                            const std::function<void()>& begun) = 0;

  // Makes what trains a level. Until the next call, the settings that the level has, and what there is of it, as "4
  // models".
  virtual std::unique_ptr<Trainee> begin(const BlockTraining& on, const BlockLevel& level) = 0;
  virtual std::vector<ConfigField> settings() = 0;
  virtual std::string parts() const = 0;
  // By sayWhatMemoryItTakes, of the finest level, and warns of what comes of it.
  virtual void sayMemory(const BlockTraining& on) const = 0;
  // How many steps the finest level, which has begun, is trained for: as soon as that is known.
  virtual void stepsAreKnown(int64_t) const {}

  // The finest level's step when the coarser level in that folder was made.
  virtual int64_t madeFrom(const fs::path& folder) const = 0;
};

// Trains the finest level into `model`, then coarser ones up to one that holds all blocks into its `levels`, each in as
// many steps as levelSteps says, or as it had planned when it was begun; those that were made before the finest came to
// where it is are made anew. The result counts the finest level's steps, and is finished when all levels are. Throws
// Error as openBlockRun and runTraining do.
TrainingResult trainInBlocks(Device& device, const Capture& capture, const fs::path& model,
                             const BlockRunOptions& options, BlockMethod& method);

}  // namespace tessera
