// Every setting of the `hash` representation (NGP-RT): flag (`--set`), default, help and the line in config.toml.
#pragma once

#include "base/config.h"
#include "compute/attention.h"
#include "compute/block_march.h"
#include "compute/virtual_grid.h"
#include "field/block_fields.h"

namespace tessera {

struct HashConfig {
  // `cpu`, the defaults below; `paper`, what the paper uses on a large graphics card.
  std::string preset = "cpu";

  // Set by training
  int level = 0;           // of detail; see train_hash.h
  int64_t finestStep = 0;  // of a coarser level: the finest one's step when it was made

  // Scene
  std::string surround = "own", background = "random";
  double near = 0.05;
  // Coarse features and attention
  int lattice = 128;
  int coarseLevels = 8, coarseFeatures = 4, coarseLog2Size = 17, coarseBase = 16;
  int width = 64, hidden = 1;
  // Fine features
  int levels = 4, fineLog2Size = 18;
  std::string aggregation = "attention", attention = "separate";
  bool attentionVaries = true;
  // What depends on the direction
  int directionWidth = 64, directionHidden = 2;
  // Marching
  double step = 0.5;
  int occupancyResolution = 128;
  // Batches
  int64_t seed = 0;
  int samplesPerStep = 1 << 16, texelsPerStep = 3 << 16;
  int firstRays = 512, mostRays = 8000;
  double photoBudgetMiB = 0;
  int stepsPerPhoto = 2;
  // Occupancy
  int occupancyEvery = 16, occupancyWarmUp = 256;
  double occupancyShare = 0.0625;
  // Optimiser
  double rate = 1e-2, fineRateFactor = 5, finalRateFactor = 0.03, constantRateShare = 0.4, networkL2 = 1e-6,
         exposureRate = 1e-3;
  int warmUpSteps = 20;
  std::string rateFall = "exponential";
  // Losses
  std::string loss = "huber";
  double lossParameter = 0.1, rampShare = 0, fullGradientDistance = 0.25;
  NumberOrAuto distortion = 0.01;  // auto: what suits the scene is found out before training (distortion_choice.h)
  double depth = 0.03, depthTolerance = 0.01, knownShare = 0.125;
  // Coarser levels of detail
  double levelShare = 0.2;
  // The length of steps follows the number of samples that rays have.
  double fewestSamples = 3, shortestStep = 0.2217, stepChange = 1e-3;
  bool exposure = true;

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
