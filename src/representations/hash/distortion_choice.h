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
    double weight = 0, psnr = 0;  // on pixels that were not trained on
  };
  int64_t steps = 0;  // of each probe
  std::vector<Probe> probes;

  double weight() const;  // of the best probe
};

struct DistortionProbing {
  std::vector<double> weights{0, 1e-3, 1e-2, 1e-1};
  double heldOutShare = 0.1;  // of the tiles of each photo
  int64_t steps = 0;          // of each probe; or
  double minutes = 0;         // > 0: of each probe: as many steps as the first one makes in this time
};

// A short training for each weight, all with the same pixels left out, on which they are then compared. Nothing when
// asked to stop. Throws Error as HashTrainer does.
std::optional<DistortionChoice> chooseDistortion(Device& device, const Capture& capture, const HashConfig& config,
                                                 const BlockGrid& grid, const DistortionProbing& probing,
                                                 const std::function<bool()>& stopRequested);

}  // namespace tessera
