// What all methods that train a capture in blocks share: starting or resuming a run, reporting its memory use, and
// training the coarser levels of detail after the finest.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "compute/device.h"
#include "partition/cut_blocks.h"
#include "train/level_folders.h"

namespace tessera {

struct BlockRunOptions {
  TrainingLoopOptions loop;
  BlockCount blocks;
  std::optional<BlockGrid> grid;  // if given, the blocks to use; overrides `blocks`
  double memoryMiB = 0;           // memory budget for blocks and photos, MiB; 0: the machine's usable memory
  uint64_t gpuBytes = 0;          // Device::ownMemory of the training device, which stores the blocks; 0: none
  std::vector<std::string> only;  // of a method that trains its parts by themselves: the names of these; empty: all

  bool requests(const std::string& name) const;  // whether the part of this name is to be trained
  double plannedBytes() const;                   // memoryMiB, or the machine's usable memory
  double bytesForBlocks() const;  // share of plannedBytes or of the GPU's memory; the rest is working memory of steps
  double bytesForPhotos() const;  // share of plannedBytes
};

// What a run requires of a capture.
struct PartitionRequirements {
  std::function<BlockLimits()> limits;  // called only if the capture is to be partitioned
  CoverageThresholds enough;
  double photoBudgetMiB = 0;  // 0: chosen by the available memory, see resolvePhotoBudget
};

struct BlockRun {
  ModelFolder folder;
  BlockGrid grid;
  bool goesOn;            // whether it resumes the model in the folder
  double photoBudgetMiB;  // 0: no limit
};

// Partitions the capture into blocks, or takes the given ones; a resumed run keeps the blocks that it had, even if the
// capture's points have changed since. Throws Error if the folder holds a capture, a model that is not to be resumed,
// or a model that was trained on other photos or in other blocks.
BlockRun openBlockRun(const Capture& capture, const fs::path& model, const BlockRunOptions& options,
                      const PartitionRequirements& partitionRequirements);

// How training divides a capture into blocks, for costsOnCapture (method_costs.h).
struct BlockDemand {
  BlockLimits limits;
  double lodStepFraction = 0;                                       // as BlockMethod returns
  uint32_t (*topLevel)(uint32_t columns, uint32_t rows) = nullptr;  // null: levels take no time of their own
};

// What all levels of detail of a run are trained on. Holds references only.
struct BlockTraining {
  Device& device;
  const Capture& capture;
  const BlockGrid& grid;
};

struct MemoryNeeds {
  double photoBudgetMiB = 0;  // 0: all training photos
  double bytesPerBlock = 0;
  std::string how, remedy;
};
// Logs how much memory training takes, followed by `how` (as ", with 4 of 9 blocks at a time"); warns with the `remedy`
// if that is more than was planned. Call it once everything but decoded photos and checkpoints has been allocated.
void reportMemoryUse(const BlockTraining& on, const BlockRunOptions& options, const MemoryNeeds& needs);

// A level of detail that is about to be trained, or resumed if its folder holds a model.
struct BlockLevel {
  uint32_t level;             // 0 is the finest
  int64_t steps;              // total steps to train; 0 for the finest level if only the training loop will know
  int64_t finestStep;         // for a coarser level: the step that the finest level has reached
  ModelFolder folder, below;  // of this level, and of the next finer one
};

// What a representation that is trained in blocks implements for trainInBlocks.
class BlockMethod {
 public:
  virtual ~BlockMethod() = default;

  virtual PartitionRequirements partitionRequirements() const = 0;
  // Returns the steps of the first coarser level as a share of the finest level's; 0: there are no coarser levels.
  virtual double lodStepFraction() const = 0;
  // Returns the coarsest level of detail for this grid, the one that holds all blocks.
  virtual uint32_t topLevel(const BlockGrid& grid) const = 0;
  // Called once the run is open; takes its photo budget. Throws Error, before anything is trained, if some level up to
  // `top` could not be trained.
  virtual void open(const BlockRun& run, uint32_t top) = 0;
  // Tunes the settings whose value is `auto`, in a run that is new or was interrupted before that was done; must call
  // `begun` once most memory is allocated. Returns false if it was asked to stop.
  virtual bool findSettings(const BlockTraining&, const BlockRun&, TrainingLoopOptions&,
                            const std::function<void()>& begun) = 0;

  // Returns the model of a level for the training loop. Until the next call, settings() returns the settings of this
  // level, and parts() describes what it is made of, as "4 models".
  virtual std::unique_ptr<TrainableModel> begin(const BlockTraining& on, const BlockLevel& level) = 0;
  virtual std::vector<ConfigField> settings() = 0;
  virtual std::string parts() const = 0;
  // Calls reportMemoryUse for the finest level, and warns of the consequences.
  virtual void reportMemory(const BlockTraining& on) const = 0;
  // Called with the total number of steps of the finest level, after begin, as soon as that number is known.
  virtual void setPlannedSteps(int64_t) const {}

  // Returns the step of the finest level at which the coarser level in `folder` was created.
  virtual int64_t finestStepOfLevel(const fs::path& folder) const = 0;
};

// Trains the finest level into `model`, then the coarser ones, up to one that holds all blocks, into its folder
// `levels`, each for as many steps as levelSteps returns or as it had planned when it was started. Coarser levels that
// were created at an earlier step of the finest level are trained again from the start. The result counts the steps of
// the finest level, and is finished when all levels are. Throws Error as openBlockRun and runTraining do.
TrainingResult trainInBlocks(Device& device, const Capture& capture, const fs::path& model,
                             const BlockRunOptions& options, BlockMethod& method);

}  // namespace tessera
