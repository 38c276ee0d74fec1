#include "representations/mesh/train/train_mesh.h"

#include "base/memory.h"
#include "representations/field/train/train_field.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

constexpr double kPhotoMemoryFraction = 0.5;  // of the usable memory

// The coarse field needs no details: only where surfaces are.
FieldConfig coarseConfig(const MeshConfig& config) {
  FieldConfig coarse;
  coarse.seed = config.seed;
  coarse.roiMargin = config.roiMargin;
  coarse.photoBudgetMiB = config.photoBudgetMiB;
  coarse.samplesPerStep = 1 << 15;
  coarse.gridLog2Size = 15;
  coarse.gridLevels = 8;
  coarse.gridFinest = 256;
  coarse.exposure = config.exposure;
  return coarse;
}

}  // namespace

TrainingResult trainMesh(Device& device, const Capture& capture, const fs::path& model, TrainMeshOptions options) {
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  options.loop.method = "mesh";
  refuseTrainedModel(folder, options.loop);
  const bool goingOn = options.loop.resume && folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  options.config.photoBudgetMiB = resolvePhotoBudget(options.config.photoBudgetMiB, capture,
                                                     kPhotoMemoryFraction * static_cast<double>(usableMemoryBytes()));
  const fs::path coarseFolder = model / "coarse";
  TrainingLoopOptions coarseLoop = options.loop;
  coarseLoop.minutes = 0;
  coarseLoop.steps = options.config.coarseSteps;
  coarseLoop.resume = ModelFolder(coarseFolder).manifest().has_value();
  const TrainingResult coarseResult =
      trainField(device, capture, coarseFolder, {coarseConfig(options.config), coarseLoop});
  if (!coarseResult.finished) return {};
  MeshStart start;
  const SceneFrame frame = ModelFolder(coarseFolder).readPlacement().frame;
  {
    const auto coarse = loadFieldModel(device, coarseFolder);
    start = findMeshStart(capture, *coarse, options.config);
  }
  MeshTrainer trainer(device, capture, options.config, frame, std::move(start));
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(),
                        reproductionHeader(device, options.loop) + configToToml(options.config.fields()));
    folder.writePlacement({frame, {}, capture.sourceFromWorld, capture.root, trainingNames(capture)},
                          options.loop.method);
  }
  return runTraining(trainer, folder, options.loop);
}

}  // namespace tessera
