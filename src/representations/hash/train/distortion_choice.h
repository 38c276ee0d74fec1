// The weight of the distortion loss, found out for a scene: the paper sets it by hand, and outdoors another one for
// each scene. It is the usual one or less. Short trainings ask for more than suits long ones, which have time to do
// without (of fox, 0.03 is best after 300 steps, and 0.01 after 1500); that less suits a scene they can tell.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "representations/hash/train/hash_trainer.h"

namespace tessera {

struct DistortionChoice {
  struct Probe {
    double weight = 0;
    std::optional<double> psnr;  // on photos that were not trained on; nothing when training came to no numbers
  };
  int64_t steps = 0;  // of each probe; 0: not known yet
  std::vector<Probe> probes;

  // Of the best probe; of several as good as it (kAsGood), the greatest: it leaves less fog where no photo that was
  // left out looks. Throws Error when none came to anything.
  static constexpr double kAsGood = 0.05;  // dB
  double weight() const;
};

struct DistortionProbing {
  std::vector<double> weights;
  uint32_t heldOutOf = 10;  // one training photo of so many is left out
  int64_t steps = 0;        // of each probe; or
  double minutes = 0;       // > 0: of each probe: as many steps as the first one makes in this time,
  int64_t fewestSteps = 0;  // or so many
  DistortionChoice known;   // probes that need not be made again
  bool progress = false;
  std::function<bool()> stopRequested = [] { return false; };
  std::function<void()> begun = [] {};  // all that a probe needs has been allocated
  std::function<void(const DistortionChoice&)> probed = [](const DistortionChoice&) {};  // one more is done
};

// A short training for each, all with the same photos left out, on which they are then compared, with the mean of the
// photos' exposures. Nothing when asked to stop. Throws Error as HashTrainer does, and where there are no photos to
// leave out, or none of their pixels is drawn.
std::optional<DistortionChoice> chooseDistortion(Device& device, const Capture& capture, const HashConfig& config,
                                                 const BlockGrid& grid, const DistortionProbing& probing);

// PSNR of what was compared; nothing where that is no number.
std::optional<double> psnrOf(const HashTrainer::Fit& fit);

}  // namespace tessera
