#include "representations/field/train/train_field.h"

#include "base/memory.h"
#include "train/run_folder.h"

namespace tessera {

constexpr double kPhotoMemoryFraction = 0.5;  // of the usable memory

TrainingResult trainField(Device& device, const Capture& capture, const fs::path& model, TrainFieldOptions options) {
  refuseFolderForModel(model);
  const ModelFolder folder(model);
  options.loop.method = "field";
  const bool goingOn = options.loop.resume && folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  // A resumed run keeps the frame of the interrupted one, even if the capture's points have changed since.
  const SceneFrame frame = goingOn ? folder.readPlacement().frame : fitSceneFrame(capture, options.config.roiMargin);
  options.config.photoBudgetMiB = resolvePhotoBudget(options.config.photoBudgetMiB, capture,
                                                     kPhotoMemoryFraction * static_cast<double>(usableMemoryBytes()));
  FieldTrainer trainer(device, capture, options.config, frame);
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(),
                        reproductionHeader(device, options.loop) + configToToml(options.config.fields()));
    folder.writePlacement({frame, {}, capture.sourceFromWorld, capture.root, trainingNames(capture)},
                          options.loop.method);
  }
  return runTraining(trainer, folder, options.loop);
}

}  // namespace tessera
