// How far the training of a model has come.
#pragma once

#include <cstdint>

#include "base/file.h"

namespace tessera {

struct TrainingProgress {
  int64_t step = 0;          // steps done
  int64_t plannedSteps = 0;  // 0: not known yet
  double seconds = 0;        // of the steps done, while it is not known how many are planned
};

// Returns what manifest.json of a model says; zeros if it is missing or damaged.
TrainingProgress readTrainingProgress(const fs::path& model);

// Returns how many rays were trained in a second in the end, by the last lines of metrics.jsonl; 0 if it says nothing.
double readRaysPerSecond(const fs::path& model);

}  // namespace tessera
