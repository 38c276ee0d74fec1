#include "train/block_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "train/block_frame.h"
#include "train/photo_window.h"
#include "train/sparse_depth.h"

namespace tessera {
namespace {

constexpr double kMiB = 1048576;
constexpr double kShareOfBlocks = 0.4, kShareOfPhotos = 0.4;
constexpr double kShareOfGpu = 0.5;  // the rest is for the working memory of steps and for other programs
constexpr double kHeap = 1.02;       // overhead of the C library's heap (1.002 was measured)

}  // namespace

bool BlockRunOptions::requests(const std::string& name) const {
  return only.empty() || std::find(only.begin(), only.end(), name) != only.end();
}
double BlockRunOptions::plannedBytes() const {
  return memoryMiB > 0 ? memoryMiB * kMiB : static_cast<double>(usableMemoryBytes());
}
double BlockRunOptions::bytesForBlocks() const {
  const double ofMachine = kShareOfBlocks * plannedBytes();
  if (gpuBytes == 0) return ofMachine;
  const double ofGpu = kShareOfGpu * static_cast<double>(gpuBytes);
  return memoryMiB > 0 ? std::min(ofGpu, ofMachine) : ofGpu;
}
double BlockRunOptions::bytesForPhotos() const {
  return kShareOfPhotos * plannedBytes();
}

BlockRun openBlockRun(const Capture& capture, const fs::path& model, const BlockRunOptions& options,
                      const PartitionRequirements& partitionRequirements) {
  refuseFolderForModel(model);
  const ModelFolder folder(model);
  refuseTrainedModel(folder, options.loop);
  const bool goesOn = folder.manifest().has_value();
  if (goesOn) requireTrainedOn(folder, capture);
  const double photoBudgetMiB =
      resolvePhotoBudget(partitionRequirements.photoBudgetMiB, capture, options.bytesForPhotos());
  if (goesOn) {
    BlockGrid grid = requireGrid(folder);
    requireSameBlocks(model / "blocks.json", grid, options.blocks, options.grid);
    return {folder, grid, true, photoBudgetMiB};
  }
  PartitionOptions partitioning;
  partitioning.blocks = options.blocks;
  partitioning.grid = options.grid;
  partitioning.limits = partitionRequirements.limits();
  partitioning.enough = partitionRequirements.enough;
  partitioning.findRayDepth = SparseDepthMedians(capture, kMaxReprojectionError);
  return {folder, cutBlocks(capture, model, partitioning), false, photoBudgetMiB};
}

void reportMemoryUse(const BlockTraining& on, const BlockRunOptions& options, const MemoryNeeds& needs) {
  constexpr double kCheckpoint = 2;  // a block that is being saved is in memory twice
  const Device::OwnMemory gpu = on.device.ownMemory();
  const Capture& capture = on.capture;
  const double all = static_cast<double>(decodedBytes(capture, capture.photosIn(Split::train)));
  const double photos = needs.photoBudgetMiB > 0 ? std::min(all, needs.photoBudgetMiB * kMiB) : all;
  const double bytes = kHeap * (static_cast<double>(residentBytes()) + photos + kCheckpoint * needs.bytesPerBlock);
  std::string ofGpu;
  if (gpu.bytes > 0) {
    ofGpu = fmt::format("; {:.0f} of the GPU's {:.0f} MiB before the first step", static_cast<double>(gpu.inUse) / kMiB,
                        static_cast<double>(gpu.bytes) / kMiB);
  }
  inform("memory: at most {:.0f} MiB{}{}", bytes / kMiB, needs.how, ofGpu);
  if (gpu.inUse > gpu.bytes)
    warn("more GPU memory is in use than the GPU has: training will be slow or fail; {}", needs.remedy);
  if (bytes <= options.plannedBytes()) return;
  warn("that is more than the {:.0f} MiB available; {}", options.plannedBytes() / kMiB, needs.remedy);
}

namespace {

// Writes the files that define the run of a level (config.toml, blocks.json), unless there is a model already.
void writeRun(const ModelFolder& folder, const BlockTraining& on, const std::vector<ConfigField>& config,
              const TrainingLoopOptions& loop) {
  if (folder.manifest()) return;
  writeFileAtomically(folder.configPath(),
                      reproductionHeader(on.device, loop, " --grid blocks.json") + configToToml(config));
  folder.writePlacement({{}, on.grid, on.capture.sourceFromWorld, on.capture.root, trainingNames(on.capture)},
                        loop.method);
}

// Returns false if it was asked to stop.
bool trainCoarserLevels(const BlockTraining& on, const fs::path& model, uint32_t top, const TrainingResult& finest,
                        TrainingLoopOptions loop, BlockMethod& method) {
  loop.minutes = 0;
  loop.resume = true;
  for (uint32_t level = 1; level <= top; ++level) {
    loop.steps = levelSteps(method.lodStepFraction(), level, finest.plannedSteps);
    if (loop.steps < 1) break;
    const ModelFolder folder(levelFolder(model, level)), below(levelFolder(model, level - 1));
    if (folder.manifest() && method.finestStepOfLevel(folder.root()) != finest.step) removeLevel(folder.root());
    if (const std::optional<ModelManifest> before = folder.manifest()) {
      if (before->step >= before->plannedSteps) continue;
      loop.steps = before->plannedSteps;
    }
    const std::unique_ptr<TrainableModel> trainable = method.begin(on, {level, loop.steps, finest.step, folder, below});
    writeRun(folder, on, method.settings(), loop);
    inform("level {}: {} blocks in {}, {} steps", level, on.grid.cells(), method.parts(), loop.steps);
    if (!runTraining(*trainable, folder, loop).finished) return false;
  }
  return true;
}

}  // namespace

TrainingResult trainInBlocks(Device& device, const Capture& capture, const fs::path& model,
                             const BlockRunOptions& options, BlockMethod& method) {
  const BlockRun run = openBlockRun(capture, model, options, method.partitionRequirements());
  const BlockTraining on{device, capture, run.grid};
  const uint32_t top = method.lodStepFraction() > 0 ? method.topLevel(run.grid) : 0;
  method.open(run, top);
  if (!run.goesOn) fs::remove_all(model / "levels");  // of a former run
  bool isMemoryReported = false;
  const auto reportMemoryOnce = [&] {
    if (!std::exchange(isMemoryReported, true)) method.reportMemory(on);
  };
  TrainingLoopOptions loop = options.loop;
  if (!method.findSettings(on, run, loop, reportMemoryOnce)) return {};
  TrainingResult result;
  {
    const std::unique_ptr<TrainableModel> trainable = method.begin(on, {0, loop.steps, 0, run.folder, run.folder});
    writeRun(run.folder, on, method.settings(), loop);
    reportMemoryOnce();
    const bool stepsAreKnown = loop.steps > 0 && !run.goesOn;  // else the loop determines them
    if (stepsAreKnown) method.setPlannedSteps(loop.steps);
    result = runTraining(*trainable, run.folder, loop);
    if (!stepsAreKnown && result.finished) method.setPlannedSteps(result.plannedSteps);
  }
  if (result.finished) result.finished = trainCoarserLevels(on, model, top, result, loop, method);
  return result;
}

}  // namespace tessera
