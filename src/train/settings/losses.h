// Settings of the losses.
#pragma once

#include "base/setting.h"

namespace tessera {

// Settings of the colour loss between renders and photos (photo_loss.h).
struct PhotoLossSettings {
  SETTING(std::string, loss, "mse", "loss", "colour loss: huber, mse or charbonnier", anything());  // see colour_loss.h
  SETTING(double, lossParameter, 0.1, "loss_parameter", "delta of huber, epsilon of charbonnier", positive());
  SETTING(bool, exposure, true, "exposure", "fit an exposure to each photo", anything());
  SETTING(double, exposureLearningRate, 5e-3, "exposure_learning_rate", "learning rate of the photos' exposures",
          atLeast(0));
};

// Settings of the gradients of samples along a ray.
struct SampleLossSettings {
  SETTING(double, fullGradientDistance, 1, "full_gradient_distance",
          "samples nearer to the camera learn more slowly, or fog gathers there; in halves of a block (without blocks: "
          "of the region of interest)",
          atLeast(0));
};

// The distortion loss of mip-NeRF 360.
struct DistortionSettings {
  SETTING(double, distortionWeight, 0.01, "distortion_weight", "weight of the distortion loss", atLeast(0));
};

struct RampSettings {
  SETTING(double, lossWarmupFraction, 0, "loss_warmup_fraction",
          "share of the steps over which the weights of the distortion loss, and of the sparsity and opacity losses if "
          "the method has them, rise from 0",
          share());
};

struct DepthLossSettings {
  SETTING(double, depthWeight, 0.03, "depth_weight", "weight of the depth loss, on rays through sparse points",
          atLeast(0));
  SETTING(double, depthTolerance, 0.01, "depth_tolerance",
          "relative tolerance of the depth loss for distances of sparse points", share());
};

}  // namespace tessera
