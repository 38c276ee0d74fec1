#include "representations/mesh/train/coarse_stage.h"

#include <algorithm>
#include <bit>

#include "representations/field/train/train_field.h"
#include "representations/mesh/train/mesh_part.h"
#include "representations/mesh/train/stage_progress.h"
#include "representations/mesh/train/trained_mesh.h"
#include "representations/mesh/train/transient_masks.h"
#include "representations/mesh/train/views_between.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

// The coarse field needs no details: only where surfaces are, and the exposures of the photos. It grows with the number
// of blocks, so that it can tell their surfaces apart.
FieldConfig coarseConfig(const MeshConfig& config, const BlockGrid& grid) {
  constexpr uint32_t kLeastFinest = 256, kMaxFinest = 2048;
  constexpr uint32_t kLeastLog2Size = 15, kMaxLog2Size = 19, kBlocksOfLeast = 4;
  constexpr int kMaxLongestOfLeast = 4;  // blocks along an edge of the region
  const uint32_t longest = static_cast<uint32_t>(std::max(grid.columns, grid.rows));
  const uint32_t blocks = static_cast<uint32_t>(grid.cells());
  FieldConfig coarse;
  coarse.seed = config.seed;
  coarse.photoBudgetMiB = config.photoBudgetMiB;
  coarse.samplesPerStep = 1 << 15;
  coarse.gridLog2Size = static_cast<int>(
      std::min(kMaxLog2Size, kLeastLog2Size + static_cast<uint32_t>(std::bit_width((blocks - 1) / kBlocksOfLeast))));
  coarse.gridLevels = 8;
  coarse.gridFinest = static_cast<int>(
      std::clamp(std::bit_ceil(static_cast<uint32_t>(config.meshCells) * longest), kLeastFinest, kMaxFinest));
  if (longest > kMaxLongestOfLeast) coarse.occupancyResolution *= 2;
  coarse.exposure = config.exposure;
  coarse.exposureLearningRate = config.exposureLearningRate;
  return coarse;
}

TrainingResult trainCoarseField(Device& device, const Capture& capture, const fs::path& model, const BlockGrid& grid,
                                const MeshConfig& config, TrainingLoopOptions loop) {
  const ModelFolder folder = coarseFolder(model);
  FieldConfig coarse = coarseConfig(config, grid);
  const bool goesOn = folder.manifest().has_value();
  loop.resume = loop.resume || goesOn;  // also from a plan before the first checkpoint
  if (loop.minutes > 0) {
    loop.minutes *= config.coarseShare;
  } else {
    loop.steps = config.coarseSteps;
  }
  if (goesOn) {
    // A finished field stays as it is: parts were trained from it, and other processes may be reading it.
    const ModelManifest manifest = requireManifest(folder, "field");
    if (manifest.plannedSteps > 0 && manifest.step >= manifest.plannedSteps)
      return {.step = manifest.step, .plannedSteps = manifest.plannedSteps, .finished = true};
    coarse.photoBudgetMiB = savedConfig<FieldConfig>(folder.root()).photoBudgetMiB;
    requireSameConfig(folder.root(), coarse);
  }
  return trainField(device, capture, folder.root(), {coarse, loop});
}

uint64_t viewSeed(const MeshConfig& config) {
  return static_cast<uint64_t>(config.seed);
}

// Makes what the parts are trained with beside the photos, unless it has been made. Throws StageStopped.
void compareWithCoarseField(Device& device, const Capture& capture, const fs::path& model, const MeshConfig& config,
                            const TrainingLoopOptions& loop) {
  const bool needsMasks = config.leavesTransientsOut() && !transientFolder(model).isComplete();
  // Without a background block, photos may be transparent, and views by the coarse field are not.
  const bool needsViews = config.enoughPhotos > 0 && config.hasBackground() && !viewsFolder(model).isComplete();
  if (!needsMasks && !needsViews) return;
  const auto coarse = loadFieldModel(device, coarseFolder(model).root());
  if (needsMasks) {
    StageProgress progress("looking for what moves", loop);
    makeTransientMasks(capture, *coarse, model, progress.onPhoto());
    progress.finish();
  }
  if (needsViews) {
    StageProgress progress("looking for places in few photos", loop);
    makeViewsBetween(capture, *coarse, model, config.enoughPhotos, viewSeed(config), progress.onPhoto());
    progress.finish();
  }
}

}  // namespace

TrainingResult trainCoarseStage(Device& device, const Capture& capture, const fs::path& mesh, const BlockGrid& grid,
                                const MeshConfig& config, const TrainingLoopOptions& loop) {
  const TrainingResult result = trainCoarseField(device, capture, mesh, grid, config, loop);
  if (!result.finished) throw StageStopped();
  compareWithCoarseField(device, capture, mesh, config, loop);
  return result;
}

Capture captureOfParts(const Capture& capture, const fs::path& mesh, const MeshConfig& config) {
  return addViewsBetween(config.leavesTransientsOut() ? applyTransientMasks(capture, mesh) : capture, mesh,
                         viewSeed(config));
}

void removeCoarseStage(const fs::path& mesh) {
  removeModel(coarseFolder(mesh));
  transientFolder(mesh).remove();
  viewsFolder(mesh).remove();
}

void removeModel(const ModelFolder& folder) {
  if (fs::exists(folder.root() / "manifest.json")) fs::remove_all(folder.root());
}

}  // namespace tessera
