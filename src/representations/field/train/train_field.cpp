#include "representations/field/train/train_field.h"

#include "base/memory.h"
#include "train/run_folder.h"

namespace tessera {

constexpr double kShareOfPhotos = 0.5;  // of the memory there is

TrainingResult trainField(Device& device, const Capture& capture, const fs::path& model, TrainFieldOptions options) {
  refuseCaptureFolder(model);
  const ModelFolder folder(model);
  options.loop.method = "field";
  const bool goingOn = options.loop.resume && folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  // A resumed run stands where the killed one stood, whatever has become of the capture's points since.
  const SceneFrame frame = goingOn ? folder.readPlacement().frame : fitSceneFrame(capture, options.config.roiMargin);
  options.config.photoBudgetMiB = settledPhotoBudget(options.config.photoBudgetMiB, capture,
                                                     kShareOfPhotos * static_cast<double>(usableMemoryBytes()));
  FieldTrainer trainer(device, capture, options.config, frame);
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(), howToRepeat(device, options.loop) + configToToml(options.config.fields()));
    folder.writePlacement({frame, {}, capture.sourceFromWorld, capture.root, trainingNames(capture)},
                          options.loop.method);
  }
  return runTraining(trainer, folder, options.loop);
}

}  // namespace tessera
