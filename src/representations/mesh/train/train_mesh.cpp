#include "representations/mesh/train/train_mesh.h"

#include <algorithm>
#include <chrono>

#include "base/memory.h"
#include "representations/field/train/train_field.h"
#include "train/colour_loss.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

constexpr double kPhotoMemoryFraction = 0.5;  // of the usable memory
constexpr double kLeastShare = 0.1;           // of the minutes, that the mesh trains for at least

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
  const auto start = std::chrono::steady_clock::now();
  options.config.check();
  colourLossKind(options.config.loss);  // throws Error
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  options.loop.method = "mesh";
  refuseTrainedModel(folder, options.loop);
  const bool goesOn = options.loop.resume && folder.manifest().has_value();
  if (goesOn) requireTrainedOn(folder, capture);
  options.config.photoBudgetMiB = resolvePhotoBudget(options.config.photoBudgetMiB, capture,
                                                     kPhotoMemoryFraction * static_cast<double>(usableMemoryBytes()));

  const ModelFolder coarseFolder(model / "coarse");
  if (!options.loop.resume) fs::remove_all(coarseFolder.root());
  FieldConfig coarse = coarseConfig(options.config);
  TrainingLoopOptions coarseLoop = options.loop;
  coarseLoop.minutes = 0;
  coarseLoop.steps = options.config.coarseSteps;
  coarseLoop.resume = coarseFolder.manifest().has_value();
  if (coarseLoop.resume) coarse.photoBudgetMiB = savedConfig<FieldConfig>(coarseFolder.root()).photoBudgetMiB;
  requireSameConfig(coarseFolder.root(), coarse);
  if (!trainField(device, capture, coarseFolder.root(), {coarse, coarseLoop}).finished) return {};

  const SceneFrame frame = (goesOn ? folder : coarseFolder).readPlacement().frame;
  MeshStart meshStart = findMeshStart(capture, *loadFieldModel(device, coarseFolder.root()), options.config);
  MeshTrainer trainer(device, capture, options.config, frame, std::move(meshStart));
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(),
                        reproductionHeader(device, options.loop) + configToToml(options.config.fields()));
    folder.writePlacement({frame, {}, capture.sourceFromWorld, capture.root, trainingNames(capture)},
                          options.loop.method);
  }
  if (!goesOn && options.loop.minutes > 0) {  // the coarse field has taken its share
    const double minutes = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / 60;
    options.loop.minutes = std::max(options.loop.minutes - minutes, kLeastShare * options.loop.minutes);
  }
  return runTraining(trainer, folder, options.loop);
}

}  // namespace tessera
