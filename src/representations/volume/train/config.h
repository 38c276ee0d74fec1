// All settings of the `volume` representation, each with its flag (`--set`), default, help text and line in
// config.toml.
#pragma once

#include "compute/blocks.h"
#include "compute/virtual_grid.h"
#include "field/block_fields.h"
#include "train/settings/blocks.h"
#include "train/settings/learning_rate.h"
#include "train/settings/losses.h"
#include "train/settings/networks.h"
#include "train/settings/rays.h"

namespace tessera {

// The defaults are those of the preset `cpu`. ofPreset changes those that differ in `paper`, which has the sizes,
// schedule, border blocks and losses of the paper, and the values of MERF where the paper states none; README.md lists
// what it has in common with `cpu` although neither states it.
struct VolumeConfig : BlockSettings,
                      RaySettings,
                      RandomBackgroundSettings,
                      TexelBudgetSettings,
                      HashGridSettings,
                      NetworkSettings,
                      HiddenLayerSettings,
                      LearningRateSettings,
                      TableDecaySettings,
                      PhotoLossSettings,
                      SampleLossSettings,
                      DistortionSettings,
                      RampSettings {
  // Virtual grid
  SETTING(int, voxels, 128, "voxels", "voxels along an edge of a block", within(8, 1024).withDivisor(8, 4));
  SETTING(int, planes, 512, "planes", "texels along an edge of a block's planes", within(8, 4096).withDivisor(8, 4));
  SETTING(double, featureRange, 7, "feature_range",
          "colours and features span plus and minus this before their activation", within(0.1, 100));
  SETTING(double, densityRange, 14, "density_range", "log densities span plus and minus this", within(0.1, 100));
  SETTING(bool, quantise, true, "quantise", "quantise attributes in training as tiles store them", anything());
  SETTING(bool, shareTexels, true, "share_texels",
          "evaluate each texel of a step once; false: each corner of each sample (one block only)", anything());
  // Proposal fields and sampling
  SETTING(int, proposalLevels, 5, "proposal_levels", "hash grid levels of a block's proposals", within(1, 64));
  SETTING(int, proposalLog2Size, 14, "proposal_log2_size", "log2 of the entries of a level", within(3, 28));
  SETTING(int, proposalFinest, 128, "proposal_finest", "finest resolution", within(gridBase, 1 << 20).dependent());
  SETTING(int, proposalWidth, 16, "proposal_width", "hidden width of the proposal networks: 16, 32, 64 or 128",
          allowedValues({16, 32, 64, 128}));
  SETTING(int, firstIntervals, 32, "first_intervals", "intervals of a ray in the first proposal round",
          within(2, 1024));
  SETTING(int, secondIntervals, 24, "second_intervals",
          "intervals of a ray in the second proposal round; 0: only one round", within(0, 1024));
  SETTING(int, samples, 16, "samples", "final samples per ray; more where it crosses from block to block",
          within(2, 1024));
  SETTING(double, uniformSampleFraction, 0.02, "uniform_sample_fraction",
          "share of the samples that are spread evenly whatever the proposals say", share());
  SETTING(int, proposalEvery, 4, "proposal_every", "steps between updates of the proposals after the warm-up",
          within(1, 1 << 20));
  SETTING(int, proposalWarmupSteps, 256, "proposal_warmup_steps", "steps during which each updates the proposals",
          within(0, 1 << 30));
  // Batches
  SETTING(int, residentBlocks, 0, "resident_blocks",
          "blocks that are in memory at once, besides a background block of its own; 0: all", within(0, 1 << 20));
  SETTING(int64_t, residencySteps, 1000, "residency_steps",
          "steps in which all blocks get their turn, where not all are in memory", within(1, 1e9));
  SETTING(double, sparseDepthMargin, 0.03, "sparse_depth_margin",
          "rays through sparse points begin and end this share of their distance before and behind the point", share());
  SETTING(bool, nearFromSparseDepth, true, "near_from_sparse_depth",
          "assume empty space in front of the nearest sparse points that a photo shows", anything());
  SETTING(
      bool, blocksOnly, false, "blocks_only",
      "draw no rays through parts of photos that see no block, for example if --grid covers only a part of the scene",
      anything());
  // Optimiser
  SETTING(double, deferredLearningRateFactor, 0.3, "deferred_learning_rate_factor",
          "learning rate of the deferred networks, relative", atLeast(0));
  // Losses
  SETTING(double, s3imWeight, 0.2, "s3im_weight", "weight of the structural similarity of random pixels", atLeast(0));
  SETTING(double, interlevelWeight, 1, "interlevel_weight", "weight of the loss that trains proposals", positive());
  SETTING(double, sparsityWeight, 0.01, "sparsity_weight", "weight of the loss on densities at random points",
          atLeast(0));
  SETTING(double, opacityWeight, 1e-3, "opacity_weight", "weight of the loss on semi-transparent blocks", atLeast(0));
  SETTING(int, sparsityPoints, 4096, "sparsity_points", "random points per step", within(0, 1 << 24));
  SETTING(double, cullBegin, 0.4, "cull_begin", "share of the steps after which culling begins", share());
  SETTING(double, cullEnd, 0.8, "cull_end", "share of the steps at which the culling threshold reaches cull_last",
          within(cullBegin, 1).dependent());
  SETTING(double, cullFirst, 5e-4, "cull_first", "initial culling threshold: opacity over a renderer's step",
          within(ConfigBounds::kTiny, 1));
  SETTING(double, cullLast, 5e-3, "cull_last", "final culling threshold, also used in baking",
          within(cullFirst, 1).dependent());
  SETTING(bool, literalEq3, false, "literal_eq3",
          "add the deferred network's colour whole, as printed, not times the block's opacity", anything());
  // Levels of detail
  SETTING(double, deferredOnlyFraction, 0.1, "deferred_only_fraction",
          "share of a coarser level's steps in which only its deferred networks are trained", share());
  SETTING(double, lodLearningRateFactor, 0.5, "lod_learning_rate_factor",
          "learning rate of a coarser level's fields, relative", atLeast(0));
  SETTING(double, lodUniformSampleFraction, 0.2, "lod_uniform_sample_fraction",
          "uniform_sample_fraction of coarser levels, if larger: it finds what their proposals miss", share());

  VolumeConfig();
  // All settings, in the order of config.toml.
  std::vector<ConfigField> fields();
  // Throws Error naming the first setting with which no model can be built.
  void check() const;
  // Returns the settings of a preset. Throws Error if there is no preset of that name.
  static VolumeConfig ofPreset(const std::string& name);

  BackgroundBlockMode backgroundBlockMode() const;
  VirtualGrid virtualGrid() const;
  BlockFieldShape attributeShape() const;
  BlockFieldShape proposalShape() const;
};

}  // namespace tessera
