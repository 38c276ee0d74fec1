#include "train/block_run.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "train/block_frame.h"
#include "train/known_distances.h"
#include "train/photo_window.h"

namespace tessera {
namespace {

constexpr double kMiB = 1048576;
constexpr double kShareOfBlocks = 0.4, kShareOfPhotos = 0.4;
constexpr double kShareOfCard = 0.5;  // the rest is for what a step works on, and for other programs
constexpr double kMostPixelsOff = 2;  // of observations whose distance is believed
constexpr double kHeap = 1.02;        // what the C library keeps besides (1.002 was measured)

}  // namespace

double BlockRunOptions::plannedBytes() const {
  return memoryMiB > 0 ? memoryMiB * kMiB : static_cast<double>(usableMemoryBytes());
}
double BlockRunOptions::bytesForBlocks() const {
  const double ofMachine = kShareOfBlocks * plannedBytes();
  if (cardBytes == 0) return ofMachine;
  const double ofCard = kShareOfCard * static_cast<double>(cardBytes);
  return memoryMiB > 0 ? std::min(ofCard, ofMachine) : ofCard;
}
double BlockRunOptions::bytesForPhotos() const {
  return kShareOfPhotos * plannedBytes();
}

BlockRun openBlockRun(const Capture& capture, const fs::path& model, const BlockRunOptions& options,
                      const BlockDemands& demands) {
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  refuseTrainedModel(folder, options.loop);
  const bool goesOn = folder.manifest().has_value();
  if (goesOn) requireTrainedOn(folder, capture);
  const double photoBudgetMiB = settledPhotoBudget(demands.photoBudgetMiB, capture, options.bytesForPhotos());
  if (goesOn) {
    BlockGrid grid = requireGrid(folder);
    requireSameBlocks(model / "blocks.json", grid, options.blocks, options.grid);
    return {folder, grid, true, photoBudgetMiB};
  }
  PartitionOptions partitioning;
  partitioning.blocks = options.blocks;
  partitioning.grid = options.grid;
  partitioning.limits = demands.limits();
  partitioning.enough = demands.enough;
  partitioning.depthOf = KnownDepths(capture, kMostPixelsOff);
  return {folder, cutBlocks(capture, model, partitioning), false, photoBudgetMiB};
}

void writeRun(const ModelFolder& folder, const BlockTraining& on, const std::vector<ConfigField>& config,
              const TrainingLoopOptions& loop) {
  if (folder.manifest()) return;
  writeFileAtomically(folder.configPath(), howToRepeat(on.device, loop, " --grid blocks.json") + configToToml(config));
  folder.writePlacement({{}, on.grid, on.capture.sourceFromWorld, on.capture.root, trainingNames(on.capture)},
                        loop.method);
}

void sayWhatMemoryItTakes(const BlockTraining& on, const BlockRunOptions& options, const MemoryNeeds& needs) {
  constexpr double kCheckpoint = 2;  // a block that is saved stands in memory twice
  const Device::OwnMemory card = on.device.ownMemory();
  const Capture& capture = on.capture;
  const double all = static_cast<double>(decodedBytes(capture, capture.photosIn(Split::train)));
  const double photos = needs.photoBudgetMiB > 0 ? std::min(all, needs.photoBudgetMiB * kMiB) : all;
  const double bytes = kHeap * (static_cast<double>(residentBytes()) + photos + kCheckpoint * needs.bytesPerBlock);
  std::string ofCard;
  if (card.bytes > 0) {
    ofCard = fmt::format("; {:.0f} of the card's {:.0f} MiB before the first step",
                         static_cast<double>(card.inUse) / kMiB, static_cast<double>(card.bytes) / kMiB);
  }
  inform("memory: at most {:.0f} MiB{}{}", bytes / kMiB, needs.how, ofCard);
  if (card.inUse > card.bytes)
    warn("the card has less: what does not fit lies in the machine's memory; {}", needs.remedy);
  if (bytes <= options.plannedBytes()) return;
  warn("that is more than the {:.0f} MiB there are; {}", options.plannedBytes() / kMiB, needs.remedy);
}

bool trainCoarserLevels(const fs::path& model, uint32_t top, double share, const TrainingResult& finest,
                        TrainingLoopOptions loop, const LevelTraining& training) {
  loop.minutes = 0;
  loop.resume = true;
  for (uint32_t level = 1; level <= top; ++level) {
    loop.steps = levelSteps(share, level, finest.plannedSteps);
    if (loop.steps < 1) break;
    const ModelFolder folder(levelFolder(model, level));
    if (folder.manifest() && training.madeFrom(folder.root()) != finest.step) removeLevel(folder.root());
    if (const std::optional<ModelManifest> before = folder.manifest()) {
      if (before->step >= before->plannedSteps) continue;
      loop.steps = before->plannedSteps;
    }
    if (!training.train(folder, level, loop)) return false;
  }
  return true;
}

}  // namespace tessera
