// Every setting of the `volume` representation: flag (`--set`), default, help and the line in config.toml.
#pragma once

#include "base/config.h"
#include "compute/blocks.h"
#include "compute/virtual_grid.h"
#include "field/block_fields.h"

namespace tessera {

struct VolumeConfig {
  // `cpu`, the defaults below; `paper`, what the paper and MERF use on large graphics cards.
  std::string preset = "cpu";

  // Scene
  std::string surround = "own";
  double near = 0.05;
  int level = 0;           // of detail; those above 0 are made from the one below, see train_volume.h
  int64_t finestStep = 0;  // of those above 0
  // Virtual grid
  int voxels = 128, planes = 512;
  double featureRange = 7, densityRange = 14;
  bool quantise = true, shareTexels = true;
  // Attribute fields
  int gridLevels = 8, gridLog2Size = 17, gridBase = 16, gridFinest = 512;
  int width = 32, hidden = 1;
  // Proposal fields and sampling
  int proposalLevels = 5, proposalLog2Size = 14, proposalFinest = 128, proposalWidth = 16;
  int firstIntervals = 32, secondIntervals = 24, samples = 16;
  double padding = 0.02;
  int proposalEvery = 4, proposalWarmUp = 256;
  // Batches
  int64_t seed = 0;
  int residentBlocks = 0;
  int64_t residencySteps = 1000;
  int texelsPerStep = 1 << 19;
  int firstRays = 1024, mostRays = 1 << 14;
  double photoBudgetMiB = 0;
  int stepsPerPhoto = 2;
  // Optimiser
  double rate = 1e-2, finalRateFactor = 0.1, constantRateShare = 0.3, deferredRateFactor = 0.3, tableL2 = 0,
         networkL2 = 1e-6, exposureRate = 1e-3;
  // Losses
  std::string loss = "charbonnier";
  double lossParameter = 1e-3, s3im = 0.2, interlevel = 1, distortion = 0.01, sparsity = 0.01, opacity = 1e-3;
  double rampShare = 0.1, fullGradientDistance = 1, knownShare = 0.05, knownBracket = 0.03;
  int sparsityPoints = 4096;
  double cullBegin = 0.4, cullEnd = 0.8, cullFirst = 5e-4, cullLast = 5e-3;
  bool literalEq3 = false;
  // Levels of detail
  double levelShare = 0.2, frozenShare = 0.1, levelRateFactor = 0.5, levelPadding = 0.2;
  bool exposure = true, randomBackground = true, freeSpace = true, blocksOnly = false;

  std::vector<ConfigField> fields();
  // Throws Error naming the first setting that no model can be made of.
  void check() const;
  // Throws Error when there is no such preset.
  static VolumeConfig ofPreset(const std::string& name);

  Surround surroundKind() const;
  VirtualGrid virtualGrid() const;
  BlockFieldShape attributeShape() const;
  BlockFieldShape proposalShape() const;
};

}  // namespace tessera
