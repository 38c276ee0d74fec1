// `--set distortion=auto`: what comes before the training of a `hash` model, and what of it is kept.
#pragma once

#include "representations/hash/train/distortion_choice.h"
#include "train/block_run.h"

namespace tessera {

// What a training of so many steps or minutes is preceded by: probes of a share of it each, but no fewer than so many
// steps, and no more of either.
inline constexpr double kProbeShare = 0.1, kMostProbeMinutes = 5;
inline constexpr int64_t kFewestProbeSteps = 64, kMostProbeSteps = 1000;
// The preset's weight, and such as are less.
DistortionProbing distortionProbing(const std::string& preset, const TrainingLoopOptions& loop);

// In the model's folder: what probes have come to, what they were made with, and, at the end, what was chosen.
fs::path distortionFile(const fs::path& model);

// Into `config`; of `loop.minutes` what that has taken is taken away, and probes that the file tells of are not made
// again where `loop.resume` says so. False when asked to stop. `begun`: as DistortionProbing has it.
bool findDistortion(const BlockTraining& on, const fs::path& model, HashConfig& config, TrainingLoopOptions& loop,
                    std::function<void()> begun);

}  // namespace tessera
