// Every setting of the `field` representation: flag (`--set`), default, help and the line in config.toml.
#pragma once

#include "compute/rays.h"
#include "field/radiance_field.h"
#include "train/settings/learning_rate.h"
#include "train/settings/losses.h"
#include "train/settings/networks.h"
#include "train/settings/occupancy.h"
#include "train/settings/rays.h"

namespace tessera {

struct FieldConfig : RaySettings,
                     RandomBackgroundSettings,
                     SampleBudgetSettings,
                     HashGridSettings,
                     NetworkSettings,
                     OccupancySettings,
                     LearningRateSettings,
                     TableDecaySettings,
                     PhotoLossSettings,
                     SampleLossSettings,
                     DistortionSettings,
                     DepthLossSettings {
  static constexpr uint32_t kMaxSteps = 16384;  // of the longest ray

  // Scene
  SETTING(bool, contracted, true, "contracted", "the scene is unbounded: contract space outside the region of interest",
          anything());
  SETTING(double, roiMargin, 1.0, "roi_margin", "region of interest relative to the one fitted to the capture",
          within(1e-6, 1e6));
  // Model
  SETTING(int, gridFeatures, 2, "grid_features", "features per hash entry", allowedValues({1, 2, 4, 8}));
  SETTING(int, densityHidden, 1, "density_hidden", "hidden layers of the density network", within(1, 16));
  SETTING(int, colourHidden, 2, "colour_hidden", "hidden layers of the colour network", within(1, 16));
  // Marching
  SETTING(double, far, 32, "far", "distance at which rays end", atLeast(near).dependent());
  SETTING(double, minStep, 0.01, "min_step", "shortest marching step", atLeast(1e-6));
  SETTING(double, cone, 0.0078125, "cone", "marching step relative to distance; 0 for uniform steps", share());
  // Batches
  SETTING(int, samplesPerMicroBatch, 1 << 16, "samples_per_micro_batch",
          "samples that a step processes at a time: fewer take less memory", within(64, 1 << 24));

  FieldConfig();
  // In the order of config.toml.
  std::vector<ConfigField> fields();
  // Throws Error that names the first invalid setting.
  void check() const;

  RadianceFieldShape shape() const;
  MarchSpace space() const;
};

}  // namespace tessera
