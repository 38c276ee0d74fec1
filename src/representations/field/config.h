// Every setting of the `field` representation: flag (`--set`), default, help and the line in config.toml.
#pragma once

#include "base/config.h"
#include "compute/rays.h"
#include "field/radiance_field.h"

namespace tessera {

struct FieldConfig {
  static constexpr uint32_t kMostSteps = 16384;  // that the longest ray may take

  // Scene
  bool contracted = true;
  double roiMargin = 1.0;
  // Model
  int gridLevels = 16, gridFeatures = 2, gridLog2Size = 17, gridBase = 16, gridFinest = 2048;
  int width = 64, densityHidden = 1, colourHidden = 2;
  // Marching
  int occupancyResolution = 128;
  double near = 0.05, far = 32, minStep = 0.01, cone = 0.0078125;
  // Batches
  int64_t seed = 0;
  int samplesPerStep = 1 << 16, samplesPerPass = 1 << 16;
  int firstRays = 512, mostRays = 1 << 14;
  double photoBudgetMiB = 0;
  int stepsPerPhoto = 2;
  // Occupancy
  int occupancyEvery = 16, occupancyWarmUp = 256;
  double occupancyShare = 0.0625;
  // Optimiser
  double rate = 1e-2, finalRateFactor = 0.03, constantRateShare = 0.4, networkL2 = 1e-6, tableL2 = 0,
         exposureRate = 1e-3;
  // Losses
  std::string loss = "mse";
  double lossParameter = 0.1, distortion = 0.01, fullGradientDistance = 1;
  double depth = 0.03, depthTolerance = 0.01, knownShare = 0.125;
  bool exposure = true, randomBackground = true;

  std::vector<ConfigField> fields();
  // Throws Error naming the first setting that no model can be made of.
  void check() const;

  RadianceFieldShape shape() const;
  MarchSpace space() const;
};

}  // namespace tessera
