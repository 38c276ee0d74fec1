// Every setting of the `hash` representation (NGP-RT): flag (`--set`), default, help and the line in config.toml.
#pragma once

#include "compute/attention.h"
#include "compute/block_march.h"
#include "compute/virtual_grid.h"
#include "field/block_fields.h"
#include "tiles/dense_layer.h"
#include "train/settings/blocks.h"
#include "train/settings/learning_rate.h"
#include "train/settings/losses.h"
#include "train/settings/networks.h"
#include "train/settings/occupancy.h"
#include "train/settings/rays.h"

namespace tessera {

// The defaults here are those of the preset `cpu`; ofPreset sets those of `paper`.
struct HashConfig : BlockSettings,
                    RaySettings,
                    SampleBudgetSettings,
                    TexelBudgetSettings,
                    NetworkSettings,
                    HiddenLayerSettings,
                    OccupancySettings,
                    LearningRateSettings,
                    PhotoLossSettings,
                    SampleLossSettings,
                    RampSettings,
                    DepthLossSettings {
  // Scene
  SETTING(std::string, background, "random", "background",
          "what rays that hit nothing show: random (whatever is behind the scene), learned (the output of the network "
          "for directions, as in the paper)",
          allowedValues({"random", "learned"}));
  // Coarse features and attention
  SETTING(int, lattice, 128, "lattice", "lattice corners along an edge of a block, for coarse features and attention",
          within(8, 1024).withDivisor(8, 4));
  SETTING(int, coarseLevels, 8, "coarse_levels", "hash grid levels of a block's coarse features",
          within(1, 128 / std::max(1, coarseFeatures)).dependent());
  SETTING(int, coarseFeatures, 4, "coarse_features", "features per entry of that hash grid",
          allowedValues({1, 2, 4, 8}));
  SETTING(int, coarseLog2Size, 17, "coarse_log2_size", "log2 of the entries of a level", within(3, 28));
  SETTING(int, coarseBase, 16, "coarse_base", "coarsest resolution of that hash grid; the finest is the lattice's",
          within(2, lattice).dependent());
  // Fine features
  SETTING(int, fineLevels, 4, "fine_levels",
          "levels of fine features: the first has twice the lattice's resolution, and each next one doubles it",
          within(1, AttentionShape::kMaxLevels));
  SETTING(int, fineLog2Size, 18, "fine_log2_size", "log2 of the entries of a level", within(3, 24));
  SETTING(std::string, aggregation, "attention", "aggregation",
          "how levels are combined: attention, sum, or mlp (a network for each sample)",
          allowedValues({"attention", "sum", "mlp"}));
  SETTING(std::string, attention, "separate", "attention",
          "weights of a level: separate (for density and colours) or shared", allowedValues({"separate", "shared"}));
  SETTING(bool, attentionVaries, true, "attention_varies",
          "the weights of levels vary from place to place; otherwise the whole model has one set", anything());
  // Direction-dependent colour
  SETTING(int, directionWidth, 64, "direction_width", "hidden width of the network for directions: 16, 32, 64 or 128",
          allowedValues({16, 32, 64, 128}));
  SETTING(int, directionHidden, 2, "direction_hidden", "hidden layers of the network for directions",
          within(1, kMaxLayers - 1.0));
  // Marching
  SETTING(double, maxRayStep, 0.5, "max_ray_step", "longest step of a ray, in edges of the lattice", within(0.01, 100));
  // The step length adapts to the average number of samples per ray.
  SETTING(double, minSamplesPerRay, 3, "min_samples_per_ray",
          "steps become shorter while rays have fewer samples than this on average", within(0, 1e6));
  SETTING(double, minRayStepRatio, 0.2217, "min_ray_step_ratio", "shortest step of a ray, relative to the longest",
          within(1e-3, 1));
  SETTING(double, rayStepChange, 1e-3, "ray_step_change",
          "relative change of the length of steps from one training step to the next", within(0, 0.5));
  // Optimiser
  SETTING(double, fineLearningRateFactor, 5, "fine_learning_rate_factor",
          "learning rate of the fine features, relative to learning_rate", atLeast(0));
  SETTING(int, warmupSteps, 20, "warmup_steps", "steps during which the learning rate rises", within(1, 1 << 30));
  SETTING(std::string, learningRateSchedule, "exponential", "learning_rate_schedule",
          "exponential: by the two settings that follow; linear: linearly from 0 to the learning rate and back to 0, "
          "as in the paper",
          allowedValues({"exponential", "linear"}));
  // Losses. auto: the weight that suits the scene is determined before training (distortion_choice.h).
  SETTING(NumberOrAuto, distortionWeight, 0.01, "distortion_weight",
          "weight of the distortion loss; auto: the preset's, or 0.3 or 0.1 times that, whichever is best on one "
          "training photo in ten that is left out, after a short training with each",
          atLeast(0));

  HashConfig();
  // In the order of config.toml.
  std::vector<ConfigField> fields();
  // Takes the values that these settings leave to be determined (auto) from `run`, the saved settings of a run that is
  // resumed. Throws Error if `run` does not have them.
  void adoptTunedValues(const HashConfig& run);
  // Throws Error that names the first invalid setting.
  void check() const;
  // Throws Error if there is no such preset.
  static HashConfig ofPreset(const std::string& name);

  BackgroundBlockMode backgroundBlockMode() const;
  AttentionShape attentionShape() const;
  bool mixesByNetwork() const { return aggregation == "mlp"; }
  VirtualGrid latticeGrid() const;      // voxels only, without planes
  BlockFieldShape coarseShape() const;  // its outputs: LatticeForward::kColumns
  HashGrid fineGrid() const;            // levels of 8 features each
  MlpShape mixShape() const;            // with mixesByNetwork: lattice columns and fine levels → 8
  MlpShape directionShape() const;      // 3 diffuse, 4 features, 16 harmonics → 3
  // The multiply-accumulate operations of a renderer for one sample: for corners, entries and weights, and for the
  // mixing network, if there is one; without directionShape(), which is evaluated once per ray.
  size_t multiplyAccumulates() const;
  // The longest step of a ray, as a fraction of the width of a domain.
  float longestStep() const { return static_cast<float>(maxRayStep / lattice); }
};

}  // namespace tessera
