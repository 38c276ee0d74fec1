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
  if (name == "cpu") return config;
  if (name != "paper") throw Error("--set preset=" + name, "", "there is no such preset", "use cpu or paper");
  config.surround = "border";
  config.background = "learned";
  config.lattice = 512;
  config.coarseLevels = 6;
  config.step = 0.5 * std::sqrt(3.0);  // half of a voxel's diagonal
  config.fineRateFactor = 1;
  config.rampShare = 0.5;
  config.distortion = 0.1;  // the paper's 0.01, beside ten times its Huber loss (compute/losses.h)
  config.warmUpSteps = 1000;
  config.rateFall = "linear";
  config.networkL2 = config.depth = config.knownShare = config.fullGradientDistance = 0;
  config.exposure = false;
  config.coarseLog2Size = 21;
  config.levels = 2;
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
      levelSetting(),
      finestStepSetting(),
      surroundSetting(),
      backgroundSetting(),
      nearSetting(),
      latticeSetting(),
      coarseLevelsSetting(),
      coarseFeaturesSetting(),
      coarseLog2SizeSetting(),
      coarseBaseSetting(),
      widthSetting(),
      hiddenSetting(),
      levelsSetting(),
      fineLog2SizeSetting(),
      aggregationSetting(),
      attentionSetting(),
      attentionVariesSetting(),
      directionWidthSetting(),
      directionHiddenSetting(),
      stepSetting(),
      occupancyResolutionSetting(),
      seedSetting(),
      samplesPerStepSetting(),
      texelsPerStepSetting().byDefault(3 << 16),
      firstRaysSetting(),
      mostRaysSetting().byDefault(8000),
      photoBudgetMiBSetting(),
      stepsPerPhotoSetting(),
      occupancyEverySetting(),
      occupancyWarmUpSetting(),
      occupancyShareSetting(),
      rateSetting(),
      fineRateFactorSetting(),
      warmUpStepsSetting(),
      rateFallSetting(),
      finalRateFactorSetting(),
      constantRateShareSetting(),
      networkL2Setting(),
      exposureRateSetting(),
      lossSetting().byDefault("huber"),
      lossParameterSetting(),
      distortionSetting(),
      rampShareSetting(),
      fullGradientDistanceSetting().byDefault(0.25),
      depthSetting(),
      depthToleranceSetting(),
      knownShareSetting(),
      levelShareSetting(),
      fewestSamplesSetting(),
      shortestStepSetting(),
      stepChangeSetting(),
      exposureSetting(),
  };
}

namespace {

// A viewer has the network's numbers in its shaders, in vectors of four.
void requireDrawable(const MlpShape& shape) {
  uint32_t vectors = 0;
  for (int layer = 0; layer < shape.layers(); ++layer) {
    const int inputs = layer == 0 ? shape.inputs : shape.width;
    const int outputs = layer == shape.hiddenLayers ? shape.outputs : shape.width;
    vectors += networkVectors(static_cast<uint32_t>(inputs), static_cast<uint32_t>(outputs));
  }
  if (vectors <= kMostNetworkVectors) return;
  throw Error(fmt::format("--set direction_width={} direction_hidden={}", shape.width, shape.hiddenLayers), "",
              fmt::format("a network of {} vectors of four numbers; scenes take {}", vectors, kMostNetworkVectors),
              "use a narrower or shallower one");
}

}  // namespace

void HashConfig::keepFound(const HashConfig& run) {
  if (distortion) return;
  if (!run.distortion) {
    throw Error("config.toml", "distortion", "is auto, where a run that has begun has a number",
                "restore the file, or train into another folder");
  }
  distortion = run.distortion;
}

void HashConfig::check() const {
  ofPreset(preset);
  surroundKind();
  HashConfig checked = *this;
  requireWithinBounds(checked.fields());
  requireDrawable(directionShape());
}

Surround HashConfig::surroundKind() const {
  return surroundNamed(surround);
}

AttentionShape HashConfig::attentionShape() const {
  AttentionShape shape;
  shape.levels = static_cast<uint32_t>(levels);
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
  grid.levels = levels;
  grid.features = static_cast<int>(AttentionShape::kFeatures);
  grid.log2TableSize = fineLog2Size;
  grid.baseResolution = 2 * lattice;
  grid.finestResolution = lattice << levels;
  return HashGrid(grid);
}

MlpShape HashConfig::mixShape() const {
  MlpShape shape;
  shape.inputs = static_cast<int>(LatticeForward::kColumns + AttentionShape::kFeatures * levels);
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
    return kCorners * (LatticeForward::kColumns + fine) + multiplyAccumulatesOf(mix);
  }
  const bool weighed = shape.weights != AttentionWeights::none;
  return kCorners * (kFeatures + (shape.varies ? shape.logits() : 0) + fine) + (weighed ? fine : 0);
}

}  // namespace tessera
