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

// What is settled by presets is for the `cpu` one here, and for `paper` in ofPreset.
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
          "what is seen where rays end nowhere: random (whatever stands behind the scene), learned (what the "
          "directions' network says, as in the paper)",
          oneOf({"random", "learned"}));
  // Coarse features and attention
  SETTING(int, lattice, 128, "lattice", "corners along an edge of a block, of coarse features and attention",
          within(8, 1024).inMultiplesOf(8, 4));
  SETTING(int, coarseLevels, 8, "coarse_levels", "hash grid levels of a block's coarse features",
          within(1, 128 / std::max(1, coarseFeatures)).dependent());
  SETTING(int, coarseFeatures, 4, "coarse_features", "features per entry of it", oneOf({1, 2, 4, 8}));
  SETTING(int, coarseLog2Size, 17, "coarse_log2_size", "log2 of the entries of a level", within(3, 28));
  SETTING(int, coarseBase, 16, "coarse_base", "coarsest resolution; the finest is the lattice's",
          within(2, lattice).dependent());
  // Fine features
  SETTING(int, levels, 4, "levels",
          "of fine features, the first of twice the lattice's resolution, each next one of twice as much",
          within(1, AttentionShape::kMostLevels));
  SETTING(int, fineLog2Size, 18, "fine_log2_size", "log2 of the entries of a level", within(3, 24));
  SETTING(std::string, aggregation, "attention", "aggregation",
          "how levels become one: attention, sum, or mlp (a network for each sample)",
          oneOf({"attention", "sum", "mlp"}));
  SETTING(std::string, attention, "separate", "attention",
          "weights of a level: separate (of density and colours) or shared", oneOf({"separate", "shared"}));
  SETTING(bool, attentionVaries, true, "attention_varies", "from place to place; else the whole model has one set",
          anything());
  // What depends on the direction
  SETTING(int, directionWidth, 64, "direction_width", "hidden width of the network for directions: 16, 32, 64 or 128",
          oneOf({16, 32, 64, 128}));
  SETTING(int, directionHidden, 2, "direction_hidden", "hidden layers of it", within(1, kMostLayers - 1.0));
  // Marching
  SETTING(double, step, 0.5, "step", "longest step of a ray, in edges of the lattice", within(0.01, 100));
  // The length of steps follows the number of samples that rays have.
  SETTING(double, fewestSamples, 3, "fewest_samples", "with fewer for each ray on average, steps become shorter",
          within(0, 1e6));
  SETTING(double, shortestStep, 0.2217, "shortest_step", "of a ray, relative to the longest", within(1e-3, 1));
  SETTING(double, stepChange, 1e-3, "step_change",
          "by which share the length of steps changes from one training step to the next", within(0, 0.5));
  // Optimiser
  SETTING(double, fineRateFactor, 5, "fine_rate_factor", "learning rate of the fine features, relative", atLeast(0));
  SETTING(int, warmUpSteps, 20, "warm_up_steps", "steps during which the learning rate rises", within(1, 1 << 30));
  SETTING(std::string, rateFall, "exponential", "rate_fall",
          "exponential: by the two settings that follow; linear: from 0 to the learning rate and to 0 again, in lines, "
          "as in the paper",
          oneOf({"exponential", "linear"}));
  // Losses. auto: what suits the scene is found out before training (distortion_choice.h).
  SETTING(NumberOrAuto, distortion, 0.01, "distortion",
          "weight of the distortion loss; auto: the preset's, or 0.3 or 0.1 times that, whichever is best on one "
          "training photo in ten that is left out, after a short training with each",
          atLeast(0));

  HashConfig();
  // In the order of config.toml.
  std::vector<ConfigField> fields();
  // What is to be found out a run that goes on has found, with these settings. Throws Error when it has not.
  void keepFound(const HashConfig& run);
  // Throws Error naming the first setting that no model can be made of.
  void check() const;
  // Throws Error when there is no such preset.
  static HashConfig ofPreset(const std::string& name);

  Surround surroundKind() const;
  AttentionShape attentionShape() const;
  bool mixesByNetwork() const { return aggregation == "mlp"; }
  VirtualGrid latticeGrid() const;      // of voxels alone
  BlockFieldShape coarseShape() const;  // → LatticeForward::kColumns
  HashGrid fineGrid() const;            // one level of 8 features after another
  MlpShape mixShape() const;            // with mixesByNetwork: lattice columns and fine levels → 8
  MlpShape directionShape() const;      // 3 diffuse, 4 features, 16 harmonics → 3
  // Of a renderer for one sample: corners, entries and weights; and the mixing network, where there is one.
  size_t multiplyAccumulates() const;
  float longestStep() const { return static_cast<float>(step / lattice); }  // of the width of a domain
};

}  // namespace tessera
