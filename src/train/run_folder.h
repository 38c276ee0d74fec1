// What training any representation into a folder shares, apart from the training loop.
#pragma once

#include "base/config.h"
#include "compute/device.h"
#include "train/training_loop.h"

namespace tessera {

// Throw Error if a folder that a model, or a scene, is to be written to holds something else: a capture or photos, a
// scene, a model. Programs that open the folder would take one for the other.
void refuseFolderForModel(const fs::path& folder);
void refuseFolderForScene(const fs::path& folder);

// Returns the first lines of config.toml, comments with the command that reproduces the run. `flags`: further flags of
// that command, as " --grid blocks.json". `lengthOfMinutes`: the flag in place of --minutes, whose number of steps
// depends on the machine's speed.
std::string reproductionHeader(const Device& device, const TrainingLoopOptions& loop, const std::string& flags = {},
                               const std::string& lengthOfMinutes = "--steps PLANNED_STEPS_OF_manifest.json");

// Returns the photo budget in MiB: `requestedMiB` if it is set; else `maxBytes` if all training photos, decoded, would
// take more than that, which it logs; else 0, no limit.
double resolvePhotoBudget(double requestedMiB, const Capture& capture, double maxBytes);

// Returns the manifest of a trained model. Throws Error if there is none or, with `method`, if the model was trained
// with another method.
ModelManifest requireManifest(const ModelFolder& folder);
ModelManifest requireManifest(const ModelFolder& folder, const std::string& method);

// Returns the settings of the run in `model`; the defaults if there is none.
template <class Config>
Config savedConfig(const fs::path& model) {
  Config config;
  const ModelFolder folder(model);
  if (fs::exists(folder.configPath())) configFromToml(config.fields(), folder.configPath());
  return config;
}

// Throws Error if the run in `model` has other settings than `now`: if it were resumed, neither would reproduce it.
// Settings that are `auto` must have been replaced by the run's values before (MethodSettings::adoptTunedValues).
void requireSameSettings(const fs::path& model, const std::vector<ConfigField>& saved,
                         const std::vector<ConfigField>& now);
template <class Config>
void requireSameConfig(const fs::path& model, Config config) {
  if (!ModelFolder(model).manifest()) return;
  Config saved = savedConfig<Config>(model);
  requireSameSettings(model, saved.fields(), config.fields());
}

}  // namespace tessera
