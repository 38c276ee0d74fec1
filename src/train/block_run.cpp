#include "train/block_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

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

namespace {

// Writes what a level's run is made of (config.toml, blocks.json), unless there is a model already.
void writeRun(const ModelFolder& folder, const BlockTraining& on, const std::vector<ConfigField>& config,
              const TrainingLoopOptions& loop) {
  if (folder.manifest()) return;
  writeFileAtomically(folder.configPath(), howToRepeat(on.device, loop, " --grid blocks.json") + configToToml(config));
  folder.writePlacement({{}, on.grid, on.capture.sourceFromWorld, on.capture.root, trainingNames(on.capture)},
                        loop.method);
}

// False when it was asked to stop.
bool trainCoarserLevels(const BlockTraining& on, const fs::path& model, uint32_t top, const TrainingResult& finest,
                        TrainingLoopOptions loop, BlockMethod& method) {
  loop.minutes = 0;
  loop.resume = true;
  for (uint32_t level = 1; level <= top; ++level) {
    loop.steps = levelSteps(method.levelShare(), level, finest.plannedSteps);
    if (loop.steps < 1) break;
    const ModelFolder folder(levelFolder(model, level)), below(levelFolder(model, level - 1));
    if (folder.manifest() && method.madeFrom(folder.root()) != finest.step) removeLevel(folder.root());
    if (const std::optional<ModelManifest> before = folder.manifest()) {
      if (before->step >= before->plannedSteps) continue;
      loop.steps = before->plannedSteps;
    }
    const std::unique_ptr<Trainee> trainee = method.begin(on, {level, loop.steps, finest.step, folder, below});
    writeRun(folder, on, method.settings(), loop);
    inform("level {}: {} blocks in {}, {} steps", level, on.grid.cells(), method.parts(), loop.steps);
    if (!runTraining(*trainee, folder, loop).finished) return false;
  }
  return true;
}

}  // namespace

TrainingResult trainInBlocks(Device& device, const Capture& capture, const fs::path& model,
                             const BlockRunOptions& options, BlockMethod& method) {
  const BlockRun run = openBlockRun(capture, model, options, method.demands());
  const BlockTraining on{device, capture, run.grid};
  const uint32_t top = method.levelShare() > 0 ? method.topLevel(run.grid) : 0;
  method.open(run, top);
  if (!run.goesOn) fs::remove_all(model / "levels");  // of a run that is no more
  bool memoryIsSaid = false;
  const auto sayMemoryOnce = [&] {
    if (!std::exchange(memoryIsSaid, true)) method.sayMemory(on);
  };
  TrainingLoopOptions loop = options.loop;
  if (!method.findSettings(on, run, loop, sayMemoryOnce)) return {};
  TrainingResult result;
  {
    const std::unique_ptr<Trainee> trainee = method.begin(on, {0, loop.steps, 0, run.folder, run.folder});
    writeRun(run.folder, on, method.settings(), loop);
    sayMemoryOnce();
    const bool stepsAreKnown = loop.steps > 0 && !run.goesOn;  // else they are settled on the way
    if (stepsAreKnown) method.stepsAreKnown(loop.steps);
    result = runTraining(*trainee, run.folder, loop);
    if (!stepsAreKnown && result.finished) method.stepsAreKnown(result.plannedSteps);
  }
  if (result.finished) result.finished = trainCoarserLevels(on, model, top, result, loop, method);
  return result;
}

}  // namespace tessera
