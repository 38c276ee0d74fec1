// Settings of the losses.
#pragma once

#include "base/setting.h"

namespace tessera {

// Of what pictures are compared with photos by (photo_loss.h).
struct PhotoLossSettings {
  SETTING(std::string, loss, "mse", "loss", "colour loss: huber, mse or charbonnier", anything());  // see colour_loss.h
  SETTING(double, lossParameter, 0.1, "loss_parameter", "delta of huber, epsilon of charbonnier", positive());
  SETTING(bool, exposure, true, "exposure", "fit an exposure to each photo", anything());
  SETTING(double, exposureRate, 1e-3, "exposure_rate", "learning rate of the photos' exposures", atLeast(0));
};

// Of the samples of a ray.
struct SampleLossSettings {
  SETTING(double, fullGradientDistance, 1, "full_gradient_distance",
          "samples nearer to the camera learn more slowly, or fog gathers there; in halves of a block (without blocks: "
          "of the region of interest)",
          atLeast(0));
};

struct DistortionSettings {
  SETTING(double, distortion, 0.01, "distortion", "weight of the distortion loss", atLeast(0));
};

struct RampSettings {
  SETTING(double, rampShare, 0, "ramp_share",
          "share of the steps over which the distortion loss, and sparsity and opacity where there are such, rise to "
          "their weight",
          share());
};

struct DepthLossSettings {
  SETTING(double, depth, 0.03, "depth", "weight of the depth loss, on rays through sparse points", atLeast(0));
  SETTING(double, depthTolerance, 0.01, "depth_tolerance", "of sparse points' distances, relative", share());
};

}  // namespace tessera
