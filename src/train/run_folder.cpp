#include "train/run_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/log.h"
#include "train/photo_window.h"

namespace tessera {

namespace {

void refuseFolderWith(const fs::path& folder, const char* file, const char* contents, const char* purpose) {
  if (!fs::exists(folder / file)) return;
  throw Error(folder.string(), "", std::string("holds ") + contents,
              std::string("name another folder for the ") + purpose);
}

constexpr const char *kCaptureFile = "transforms.json", *kCapture = "a capture or photos";

}  // namespace

void refuseFolderForModel(const fs::path& folder) {
  refuseFolderWith(folder, kCaptureFile, kCapture, "model");
  refuseFolderWith(folder, "tileset.json", "a scene", "model");
}

void refuseFolderForScene(const fs::path& folder) {
  refuseFolderWith(folder, kCaptureFile, kCapture, "scene");
  refuseFolderWith(folder, "manifest.json", "a model", "scene");
  refuseFolderWith(folder, "blocks.json", "a model", "scene");
}

// The rest of what defines a run is in blocks.json (the capture) and manifest.json (the number of steps).
std::string reproductionHeader(const Device& device, const TrainingLoopOptions& loop, const std::string& flags,
                               const std::string& lengthOfMinutes) {
  return fmt::format(
      "# tessera train CAPTURE MODEL --method {}{} --config THIS_FILE {}\n"
      "# CAPTURE: see blocks.json. Computed on {}.\n\n",
      loop.method, flags,
      loop.minutes > 0 ? lengthOfMinutes : fmt::format("--steps {}", loop.steps > 0 ? loop.steps : kDefaultSteps),
      device.target());
}

double resolvePhotoBudget(double requestedMiB, const Capture& capture, double maxBytes) {
  constexpr double kMiB = 1048576;
  if (requestedMiB > 0) return requestedMiB;
  const double all = static_cast<double>(decodedBytes(capture, capture.photosIn(Split::train)));
  if (all <= maxBytes) return 0;
  const double budget = std::max(0.001, std::floor(maxBytes / kMiB * 1000) / 1000);
  inform("the training photos take {:.0f} MiB decoded, more than their share of memory: photo_budget_mib is {}",
         all / kMiB, budget);
  return budget;
}

ModelManifest requireManifest(const ModelFolder& folder) {
  const std::optional<ModelManifest> manifest = folder.manifest();
  if (manifest) return *manifest;
  throw Error(folder.root().string(), "manifest.json", "is missing: this is not a trained model",
              "train one with: tessera train CAPTURE " + folder.root().string());
}

ModelManifest requireManifest(const ModelFolder& folder, const std::string& method) {
  ModelManifest manifest = requireManifest(folder);
  if (manifest.method == method) return manifest;
  throw Error(folder.root().string(), "manifest.json",
              "was trained with --method " + manifest.method + ", but --method " + method + " is required",
              "name another model");
}

void requireSameSettings(const fs::path& model, const std::vector<ConfigField>& saved,
                         const std::vector<ConfigField>& now) {
  for (size_t i = 0; i < now.size(); ++i) {
    const std::string was = configValueText(saved[i]), is = configValueText(now[i]);
    if (was == is) continue;
    throw Error(model.string(), "config.toml", fmt::format("the run has {}={}, not {}", now[i].name, was, is),
                "resume without that setting, or train into another folder");
  }
}

}  // namespace tessera
