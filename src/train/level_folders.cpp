#include "train/level_folders.h"

#include <algorithm>
#include <cmath>

#include "base/log.h"

namespace tessera {

fs::path levelFolder(const fs::path& model, uint32_t level) {
  return level == 0 ? model : model / "levels" / std::to_string(level);
}

void removeLevel(const fs::path& folder) {
  fs::remove(folder / "manifest.json");
  fs::remove_all(folder);
}

int64_t levelSteps(double share, uint32_t level, int64_t finestSteps) {
  const double ofFinest = std::min(1.0, std::ldexp(share, static_cast<int>(level) - 1));
  return static_cast<int64_t>(std::max(ofFinest, share) * static_cast<double>(finestSteps));
}

uint32_t trainedLevels(const fs::path& model, const std::function<int64_t(const fs::path&)>& finestStepOfLevel) {
  const std::optional<ModelManifest> finest = ModelFolder(model).manifest();
  for (uint32_t levels = 1;; ++levels) {
    const fs::path folder = levelFolder(model, levels);
    const std::optional<ModelManifest> next = ModelFolder(folder).manifest();
    if (!finest || !next || next->step < next->plannedSteps) return levels;
    if (finestStepOfLevel(folder) == finest->step) continue;
    warn("{}: created before the model reached step {}; it is ignored until you run: tessera train ... --resume",
         folder.string(), finest->step);
    return levels;
  }
}

}  // namespace tessera
