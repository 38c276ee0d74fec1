#include "representations/field/train_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"

namespace tessera {
namespace {

// The rest of what a run is made of stands in blocks.json (which capture) and manifest.json (how many steps).
std::string howToRepeat(const Device& device, const TrainingLoopOptions& loop) {
  return fmt::format(
      "# tessera train CAPTURE MODEL --method {} --config THIS_FILE --steps {}\n"
      "# CAPTURE: see blocks.json. Computed on {}.\n\n",
      loop.method, loop.minutes > 0 ? "PLANNED_STEPS_OF_manifest.json" : std::to_string(loop.steps), device.target());
}

}  // namespace

void settlePhotoBudget(FieldConfig& config, const Capture& capture, int64_t usableMemory) {
  constexpr double kMiB = 1048576;
  const double most = static_cast<double>(usableMemory) / 2;
  if (config.photoBudgetMiB > 0) return;
  const double all = static_cast<double>(decodedBytes(capture, capture.photosIn(Split::train)));
  if (all <= most) return;
  config.photoBudgetMiB = std::max(0.001, std::floor(most / kMiB * 1000) / 1000);
  inform("the training photos take {:.0f} MiB decoded, more than half of the memory there is: photo_budget_mib is {}",
         all / kMiB, config.photoBudgetMiB);
}

TrainingResult trainField(Device& device, const Capture& capture, const fs::path& model, TrainFieldOptions options) {
  if (fs::exists(model / "transforms.json")) {
    throw Error(model.string(), "", "holds a capture or photos", "name another folder for the model");
  }
  const ModelFolder folder(model);
  options.loop.method = "field";
  const bool goingOn = options.loop.resume && folder.manifest().has_value();
  if (goingOn) requireTrainedOn(folder, capture);
  // A resumed run stands where the killed one stood, whatever has become of the capture's points since.
  const SceneFrame frame = goingOn ? folder.readPlacement().frame : fitSceneFrame(capture, options.config.roiMargin);
  settlePhotoBudget(options.config, capture, usableMemoryBytes());
  FieldTrainer trainer(device, capture, options.config, frame);
  if (!folder.manifest()) {
    writeFileAtomically(folder.configPath(), howToRepeat(device, options.loop) + configToToml(options.config.fields()));
    folder.writePlacement({frame, capture.sourceFromWorld, capture.root, trainingNames(capture)}, options.loop.method);
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
