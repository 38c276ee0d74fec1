// Chooses the weight of the distortion loss for a scene. The paper sets it by hand, and outdoors to a different value
// for each scene. Only the preset's weight and smaller ones are tried: short trainings prefer larger weights than long
// ones need (for the capture fox, 0.03 is best after 300 steps, and 0.01 after 1500), but they do show when a
// scene needs a smaller weight.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "representations/hash/train/hash_trainer.h"

namespace tessera {

struct DistortionChoice {
  struct Probe {
    double weight = 0;
    std::optional<double> psnr;  // on photos that were left out of the training; nothing if the training diverged
  };
  int64_t steps = 0;  // of each probe; 0: not known yet
  std::vector<Probe> probes;

  // Returns the weight of the best probe, or the largest weight of several probes that are equally good (within
  // kAsGood): it leaves less fog where none of the photos that were left out looks. Throws Error if all probes
  // diverged.
  static constexpr double kAsGood = 0.05;  // dB
  double weight() const;
};

struct DistortionSearch {
  std::vector<double> weights;
  uint32_t holdOutInterval = 10;  // one in this many training photos is left out
  int64_t steps = 0;              // of each probe, if `minutes` is 0
  double minutes = 0;             // > 0: each probe has as many steps as the first one completes in this time,
  int64_t minSteps = 0;           // but at least this many
  DistortionChoice known;         // results of an earlier search, which are not computed again
  bool progress = false;
  std::function<bool()> stopRequested = [] { return false; };
  std::function<void()> begun = [] {};  // called when a probe has allocated its memory
  std::function<void(const DistortionChoice&)> probed = [](const DistortionChoice&) {};  // called after each probe
};

// Runs a short training for each weight, all with the same photos left out, and evaluates each on these photos with the
// mean exposure of the others. Returns nothing if it was asked to stop. Throws Error as HashTrainer does, and if there
// are no photos to leave out or none of their pixels is sampled.
std::optional<DistortionChoice> chooseDistortion(Device& device, const Capture& capture, const HashConfig& config,
                                                 const BlockGrid& grid, const DistortionSearch& probing);

// Returns the PSNR of an evaluation, or nothing if the error is not finite. Throws Error if it contains no pixels.
std::optional<double> computePsnr(const HashTrainer::Evaluation& evaluate);

}  // namespace tessera
