#include "representations/field/train_field.h"

#include <fmt/format.h>

#include "base/error.h"

namespace tessera {

TrainingResult trainField(Device& device, const Capture& capture, const fs::path& model, TrainFieldOptions options) {
  const ModelFolder folder(model);
  options.loop.method = "field";
  const bool goingOn = options.loop.resume && folder.manifest().has_value();
  // A resumed run stands where the killed one stood, whatever has become of the capture's points since.
  const SceneFrame frame = goingOn ? folder.readPlacement().frame : fitSceneFrame(capture, options.config.roiMargin);
  FieldTrainer trainer(device, capture, options.config, frame);
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(), configToToml(options.config.fields()));
    folder.writePlacement({frame, capture.sourceFromWorld, capture.root}, options.loop.method);
  }
  return runTraining(trainer, folder, options.loop);
}

FieldConfig resumedFieldConfig(const fs::path& model) {
  FieldConfig config;
  const ModelFolder folder(model);
  if (fs::exists(folder.configPath())) configFromToml(config.fields(), folder.configPath());
  return config;
}

void requireSameConfig(const fs::path& model, FieldConfig config) {
  if (!ModelFolder(model).manifest()) return;
  FieldConfig saved = resumedFieldConfig(model);
  const std::vector<ConfigField> before = saved.fields(), now = config.fields();
  for (size_t i = 0; i < now.size(); ++i) {
    const std::string was = configValueText(before[i]), is = configValueText(now[i]);
    if (was == is) continue;
    throw Error(model.string(), "config.toml", fmt::format("the run has {}={}, not {}", now[i].name, was, is),
                "resume without that setting, or train into another folder");
  }
}

}  // namespace tessera
