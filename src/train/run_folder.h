// What training any representation into a folder has in common, around the loop.
#pragma once

#include "base/config.h"
#include "compute/device.h"
#include "train/training_loop.h"

namespace tessera {

// Throws Error when `model` holds a capture or photos: a model written there would be taken for part of it.
void refuseCaptureFolder(const fs::path& model);

// The first lines of config.toml. `flags`: more of them, as " --grid blocks.json".
std::string howToRepeat(const Device& device, const TrainingLoopOptions& loop, const std::string& flags = {});

// The photo budget in MiB to train with: `wanted` if it is set; else `mostBytes` where all training photos, decoded,
// would take more than that, which it says; else 0, no limit.
double settledPhotoBudget(double wanted, const Capture& capture, double mostBytes);

// The manifest of a trained model. Throws Error when there is none; and, of a method, when it is another one's.
ModelManifest requireManifest(const ModelFolder& folder);
ModelManifest requireManifest(const ModelFolder& folder, const std::string& method);

// The settings of the run that `model` holds; the defaults when it holds none.
template <class Config>
Config savedConfig(const fs::path& model) {
  Config config;
  const ModelFolder folder(model);
  if (fs::exists(folder.configPath())) configFromToml(config.fields(), folder.configPath());
  return config;
}

// Throws Error when `model` holds a run of other settings: resumed, it would be repeatable from neither. What is left
// to be found out (`auto`) is what the run has found.
void requireSameSettings(const fs::path& model, const std::vector<ConfigField>& saved,
                         const std::vector<ConfigField>& now);
template <class Config>
void requireSameConfig(const fs::path& model, Config config) {
  if (!ModelFolder(model).manifest()) return;
  Config saved = savedConfig<Config>(model);
  requireSameSettings(model, saved.fields(), config.fields());
}

}  // namespace tessera
