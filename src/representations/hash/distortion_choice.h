// The weight of the distortion loss, found out for a scene: the paper sets it by hand, and outdoors another one for
// each scene.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "representations/hash/hash_trainer.h"

namespace tessera {

struct DistortionChoice {
  struct Probe {
    double weight = 0;
    std::optional<double> psnr;  // on pixels that were not trained on; nothing when training came to no numbers
  };
  int64_t steps = 0;  // of each probe; 0: not known yet
  std::vector<Probe> probes;

  // Of the best probe. Throws Error when none came to anything.
  double weight() const;
};

struct DistortionProbing {
  std::vector<double> weights{1e-3, 3e-3, 1e-2, 3e-2};
  double heldOutShare = 0.1;  // of the tiles of each photo
  int sizeDivisor = 8;        // of a step's rays, samples and corners
  int64_t steps = 0;          // of each probe; or
  double minutes = 0;         // > 0: of each probe: as many steps as the first one makes in this time
  DistortionChoice known;     // probes that need not be made again
  bool progress = false;
  std::function<bool()> stopRequested = [] { return false; };
  std::function<void()> begun = [] {};  // all that a probe needs has been allocated
  std::function<void(const DistortionChoice&)> probed = [](const DistortionChoice&) {};  // one more is done
};

// A short training for each weight, all with the same pixels left out, on which they are then compared. Nothing when
// asked to stop. Throws Error as HashTrainer does, and where all pixels that are left out are masked.
std::optional<DistortionChoice> chooseDistortion(Device& device, const Capture& capture, const HashConfig& config,
                                                 const BlockGrid& grid, const DistortionProbing& probing);

// The settings of a probe.
HashConfig probedConfig(HashConfig config, double weight, int sizeDivisor);

// PSNR of what was compared; nothing where that is no number.
std::optional<double> psnrOf(const HashTrainer::Fit& fit);

}  // namespace tessera
