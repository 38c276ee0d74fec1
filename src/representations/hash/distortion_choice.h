// The weight of the distortion loss, found out for a scene: the paper sets it by hand, and outdoors another one for
// each scene. The better a model gets, the smaller is the weight that suits it, as the colour loss falls and this one
// does not. What is found out is therefore the weight relative to the colours' squared error, which changes less from
// short trainings to long ones (how well that does: docs/benchmarks.md).
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "representations/hash/hash_trainer.h"

namespace tessera {

struct DistortionChoice {
  struct Probe {
    double relative = 0;         // HashConfig::distortionRelative
    std::optional<double> psnr;  // on photos that were not trained on; nothing when training came to no numbers
  };
  int64_t steps = 0;  // of each probe; 0: not known yet
  std::vector<Probe> probes;

  // Of the best probe; of several as good as it (kAsGood), the greatest: it leaves less fog where no photo that was
  // left out looks. Throws Error when none came to anything.
  static constexpr double kAsGood = 0.05;  // dB
  double relative() const;
};

struct DistortionProbing {
  std::vector<double> relatives{0.3, 1, 3, 10};
  double most = 0.03;       // of the weight itself: more flattens whatever is there
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
