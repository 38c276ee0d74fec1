// Where the coarser levels of detail of a model are, and which of them can be used: MODEL/levels/<level>, each a model
// folder of its own, made when the finest is trained.
#pragma once

#include "train/run_folder.h"

namespace tessera {

// The model's own for the finest (0), MODEL/levels/<level> for those above.
fs::path levelFolder(const fs::path& model, uint32_t level);

// Whatever it holds. Its manifest goes first: killed in between, it is no model that lacks files.
void removeLevel(const fs::path& folder);

// How long a level is trained: `share` of the finest's steps for the first, then twice as many each, as the same rays
// ask for fewer texels; no more than the finest's, or `share` of them.
int64_t levelSteps(double share, uint32_t level, int64_t finestSteps);

// As trainedLevels; `madeFrom(folder)`: the finest level's step when that level was made.
uint32_t trainedLevels(const fs::path& model, const std::function<int64_t(const fs::path&)>& madeFrom);

// Levels that are trained to their end, without a gap: at least 1, the finest. Warns of one that was made before the
// finest came to where it is; it counts as not trained.
template <class Config>
uint32_t trainedLevels(const fs::path& model) {
  return trainedLevels(model, [](const fs::path& level) { return savedConfig<Config>(level).finestStep; });
}

}  // namespace tessera
