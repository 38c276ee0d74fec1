#include "representations/hash/train/config.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "compute/lattice.h"
#include "train/block_frame.h"

namespace tessera {

HashConfig HashConfig::ofPreset(const std::string& name) {
  HashConfig config;
  config.preset = name;
  if (!isPaperPreset(name)) return config;
  config.backgroundBlock = "border";
  config.background = "learned";
  config.lattice = 512;
  config.coarseLevels = 6;
  config.maxRayStep = 0.5 * std::sqrt(3.0);  // half of a voxel's diagonal
  config.fineLearningRateFactor = 1;
  config.lossWarmupFraction = 0.5;
  config.distortionWeight = 0.1;  // the paper's 0.01 times 10, as this Huber loss is (compute/losses.h)
  config.warmupSteps = 1000;
  config.learningRateSchedule = "linear";
  config.networkL2 = config.depthWeight = config.sparseDepthRayFraction = config.fullGradientDistance = 0;
  config.exposure = false;
  config.coarseLog2Size = 21;
  config.fineLevels = 2;
  config.fineLog2Size = 22;
  config.samplesPerStep = 1 << 20;
  config.texelsPerStep = 1 << 21;
  return config;
}

HashConfig::HashConfig() {
  setOwnDefaults(fields());
}

std::vector<ConfigField> HashConfig::fields() {
  return {
      presetSetting(),
      lodSetting(),
      finestStepSetting(),
      backgroundBlockSetting(),
      backgroundSetting(),
      nearSetting(),
      latticeSetting(),
      coarseLevelsSetting(),
      coarseFeaturesSetting(),
      coarseLog2SizeSetting(),
      coarseBaseSetting(),
      widthSetting(),
      hiddenSetting(),
      fineLevelsSetting(),
      fineLog2SizeSetting(),
      aggregationSetting(),
      attentionSetting(),
      attentionVariesSetting(),
      directionWidthSetting(),
      directionHiddenSetting(),
      maxRayStepSetting(),
      occupancyResolutionSetting(),
      seedSetting(),
      samplesPerStepSetting(),
      texelsPerStepSetting().byDefault(3 << 16),
      firstRaysSetting(),
      maxRaysSetting().byDefault(8000),
      photoBudgetMiBSetting(),
      stepsPerPhotoSetting(),
      occupancyEverySetting(),
      occupancyWarmupStepsSetting(),
      occupancyUpdateFractionSetting(),
      learningRateSetting(),
      fineLearningRateFactorSetting(),
      warmupStepsSetting(),
      learningRateScheduleSetting(),
      finalLearningRateFactorSetting(),
      constantLearningRateFractionSetting(),
      networkL2Setting(),
      exposureLearningRateSetting(),
      lossSetting().byDefault("huber"),
      lossParameterSetting(),
      distortionWeightSetting(),
      lossWarmupFractionSetting(),
      fullGradientDistanceSetting().byDefault(0.25),
      depthWeightSetting(),
      depthToleranceSetting(),
      sparseDepthRayFractionSetting(),
      lodStepFractionSetting(),
      minSamplesPerRaySetting(),
      minRayStepRatioSetting(),
      rayStepChangeSetting(),
      exposureSetting(),
  };
}

namespace {

// Throws Error if the network exceeds what viewers can hold: their shaders contain its weights, in vectors of four.
void requireRenderSource(const MlpShape& shape) {
  uint32_t vectors = 0;
  for (int layer = 0; layer < shape.layers(); ++layer) {
    const int inputs = layer == 0 ? shape.inputs : shape.width;
    const int outputs = layer == shape.hiddenLayers ? shape.outputs : shape.width;
    vectors += networkVectors(static_cast<uint32_t>(inputs), static_cast<uint32_t>(outputs));
  }
  if (vectors <= kMaxNetworkVectors) return;
  throw Error(fmt::format("--set direction_width={} direction_hidden={}", shape.width, shape.hiddenLayers), "",
              fmt::format("a network of {} vectors of four numbers; scenes take {}", vectors, kMaxNetworkVectors),
              "use a narrower or shallower one");
}

}  // namespace

void HashConfig::adoptTunedValues(const HashConfig& run) {
  if (distortionWeight) return;
  if (!run.distortionWeight) {
    throw Error("config.toml", "distortion_weight",
                "is auto, but the config.toml of a run that has begun must have a number",
                "restore the file, or train into another folder");
  }
  distortionWeight = run.distortionWeight;
}

void HashConfig::check() const {
  ofPreset(preset);
  backgroundBlockMode();
  HashConfig checked = *this;
  requireWithinBounds(checked.fields());
  requireRenderSource(directionShape());
}

BackgroundBlockMode HashConfig::backgroundBlockMode() const {
  return parseBackgroundBlockMode(backgroundBlock);
}

AttentionShape HashConfig::attentionShape() const {
  AttentionShape shape;
  shape.levels = static_cast<uint32_t>(fineLevels);
  shape.weights = aggregation == "sum"    ? AttentionWeights::none
                  : attention == "shared" ? AttentionWeights::shared
                                          : AttentionWeights::separate;
  shape.varies = attentionVaries;
  return shape;
}

VirtualGrid HashConfig::latticeGrid() const {
  VirtualGrid grid;
  grid.voxels = static_cast<uint32_t>(lattice);
  grid.planes = 0;
  return grid;
}

BlockFieldShape HashConfig::coarseShape() const {
  HashGridOptions grid;
  grid.levels = coarseLevels;
  grid.features = coarseFeatures;
  grid.log2TableSize = coarseLog2Size;
  grid.baseResolution = coarseBase;
  grid.finestResolution = lattice;
  return makeBlockFieldShape(grid, width, hidden, static_cast<int>(LatticeForward::kColumns), OutputActivation::none);
}

HashGrid HashConfig::fineGrid() const {
  HashGridOptions grid;
  grid.levels = fineLevels;
  grid.features = static_cast<int>(AttentionShape::kFeatures);
  grid.log2TableSize = fineLog2Size;
  grid.baseResolution = 2 * lattice;
  grid.finestResolution = lattice << fineLevels;
  return HashGrid(grid);
}

MlpShape HashConfig::mixShape() const {
  MlpShape shape;
  shape.inputs = static_cast<int>(LatticeForward::kColumns + AttentionShape::kFeatures * fineLevels);
  shape.width = width;
  shape.hiddenLayers = 1;
  shape.outputs = static_cast<int>(AttentionShape::kFeatures);
  return shape;
}

MlpShape HashConfig::directionShape() const {
  MlpShape shape;
  shape.inputs = static_cast<int>(AttentionShape::kFeatures) - 1 + 16;
  shape.width = directionWidth;
  shape.hiddenLayers = directionHidden;
  shape.outputs = 3;
  return shape;
}

size_t HashConfig::multiplyAccumulates() const {
  constexpr size_t kCorners = 8, kFeatures = AttentionShape::kFeatures;
  const AttentionShape shape = attentionShape();
  const size_t fine = kFeatures * shape.levels;
  if (mixesByNetwork()) {
    const MlpShape mix = mixShape();
    return kCorners * (LatticeForward::kColumns + fine) + countMultiplyAccumulates(mix);
  }
  const bool weighed = shape.weights != AttentionWeights::none;
  return kCorners * (kFeatures + (shape.varies ? shape.logits() : 0) + fine) + (weighed ? fine : 0);
}

}  // namespace tessera
