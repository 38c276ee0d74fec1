// `--set distortion_weight=auto`: determines the weight before the training of a `hash` model, and records the search.
#pragma once

#include "representations/hash/train/distortion_choice.h"
#include "train/block_run.h"

namespace tessera {

// Each probe takes this fraction of the training's steps or minutes, within these bounds.
inline constexpr double kProbeShare = 0.1, kMaxProbeMinutes = 5;
inline constexpr int64_t kMinProbeSteps = 64, kMaxProbeSteps = 1000;
// Returns the search for a training: over the preset's weight and smaller ones.
DistortionSearch distortionSearch(const std::string& preset, const TrainingLoopOptions& loop);

// Returns the path of the file in the model's folder that records the results of the probes, the settings they were run
// with and, at the end, the weight that was chosen.
fs::path distortionFile(const fs::path& model);

// Determines the weight and stores it in `config`. Subtracts the time that this takes from `loop.minutes`. With
// `loop.resume`, probes that the file records are not repeated. Returns false if it was asked to stop. `begun`: see
// DistortionSearch.
bool tuneDistortionWeight(const BlockTraining& on, const fs::path& model, HashConfig& config, TrainingLoopOptions& loop,
                          std::function<void()> begun);

}  // namespace tessera
