// The coarser levels of detail of a model. Each is a model folder of its own, MODEL/levels/<level>, which is trained
// after the finest level.
#pragma once

#include "train/run_folder.h"

namespace tessera {

// Returns the model's own folder for the finest level (0), MODEL/levels/<level> for the coarser ones.
fs::path levelFolder(const fs::path& model, uint32_t level);

// Removes the folder with everything in it. The manifest is removed first, so that a process killed in between does not
// leave a model that lacks files.
void removeLevel(const fs::path& folder);

// Returns the number of steps of a level: `share` of the finest level's steps for level 1, and twice as many for each
// next one, because the same rays need fewer texels; at most max(1, share) times the finest level's steps.
int64_t levelSteps(double share, uint32_t level, int64_t finestSteps);

// See the template below; `finestStepOfLevel(folder)` returns the step of the finest level at which the level in that
// folder was created.
uint32_t trainedLevels(const fs::path& model, const std::function<int64_t(const fs::path&)>& finestStepOfLevel);

// Returns how many levels are fully trained, counted from the finest without a gap; at least 1, the finest. Warns of a
// level that was created at an earlier step of the finest level; it counts as not trained.
template <class Config>
uint32_t trainedLevels(const fs::path& model) {
  return trainedLevels(model, [](const fs::path& level) { return savedConfig<Config>(level).finestStep; });
}

}  // namespace tessera
