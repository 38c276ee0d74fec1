#include "representations/volume/train/config.h"

#include "train/block_frame.h"

namespace tessera {

VolumeConfig VolumeConfig::ofPreset(const std::string& name) {
  VolumeConfig config;
  config.preset = name;
  if (!isPaperPreset(name)) return config;
  config.backgroundBlock = "border";
  config.voxels = 512;
  config.planes = 2048;
  config.gridLevels = 16;
  config.gridLog2Size = 19;
  config.gridFinest = 2048;
  config.width = 64;
  config.hidden = 3;
  config.proposalLog2Size = 17;
  config.proposalFinest = 256;
  config.firstIntervals = config.secondIntervals = 64;
  config.samples = 32;
  config.proposalEvery = 1;
  // With these networks, more would exceed what operations can index (2^31 activations). A step has fewer than 16384
  // rays if these need more distinct texels.
  config.texelsPerStep = 5 << 20;
  config.firstRays = config.maxRays = 16384;
  config.sparsityPoints = 1 << 17;
  config.constantLearningRateFraction = 0;
  // The following are not in the paper.
  config.networkL2 = config.fullGradientDistance = config.sparseDepthRayFraction = 0;
  config.uniformSampleFraction = 0;
  config.deferredLearningRateFactor = 1;
  config.nearFromSparseDepth = config.exposure = false;
  return config;
}

VolumeConfig::VolumeConfig() {
  setOwnDefaults(fields());
}

std::vector<ConfigField> VolumeConfig::fields() {
  return {
      presetSetting(),
      backgroundBlockSetting(),
      lodSetting(),
      finestStepSetting(),
      nearSetting(),
      voxelsSetting(),
      planesSetting(),
      featureRangeSetting(),
      densityRangeSetting(),
      quantiseSetting(),
      shareTexelsSetting(),
      gridLevelsSetting(),
      gridLog2SizeSetting(),
      gridBaseSetting(),
      gridFinestSetting(),
      widthSetting().byDefault(32),
      hiddenSetting(),
      proposalLevelsSetting(),
      proposalLog2SizeSetting(),
      proposalFinestSetting(),
      proposalWidthSetting(),
      firstIntervalsSetting(),
      secondIntervalsSetting(),
      samplesSetting(),
      uniformSampleFractionSetting(),
      proposalEverySetting(),
      proposalWarmupStepsSetting(),
      seedSetting(),
      residentBlocksSetting(),
      residencyStepsSetting(),
      texelsPerStepSetting().within(1024, 1 << 26),
      firstRaysSetting().byDefault(1024).within(16, maxRays),
      maxRaysSetting().within(64, 1 << 20),
      photoBudgetMiBSetting(),
      stepsPerPhotoSetting(),
      learningRateSetting(),
      finalLearningRateFactorSetting().byDefault(0.1),
      constantLearningRateFractionSetting().byDefault(0.3),
      deferredLearningRateFactorSetting(),
      tableL2Setting(),
      networkL2Setting(),
      exposureLearningRateSetting(),
      lossSetting().byDefault("charbonnier"),
      lossParameterSetting().byDefault(1e-3),
      s3imWeightSetting(),
      interlevelWeightSetting(),
      distortionWeightSetting(),
      sparsityWeightSetting(),
      opacityWeightSetting(),
      lossWarmupFractionSetting().byDefault(0.1),
      sparsityPointsSetting(),
      cullBeginSetting(),
      cullEndSetting(),
      cullFirstSetting(),
      cullLastSetting(),
      literalEq3Setting(),
      fullGradientDistanceSetting(),
      sparseDepthRayFractionSetting().byDefault(0.05),
      sparseDepthMarginSetting(),
      nearFromSparseDepthSetting(),
      blocksOnlySetting(),
      lodStepFractionSetting(),
      deferredOnlyFractionSetting(),
      lodLearningRateFactorSetting(),
      lodUniformSampleFractionSetting(),
      exposureSetting(),
      randomBackgroundSetting(),
  };
}

void VolumeConfig::check() const {
  backgroundBlockMode();
  ofPreset(preset);
  VolumeConfig checked = *this;
  requireWithinBounds(checked.fields());
}

BackgroundBlockMode VolumeConfig::backgroundBlockMode() const {
  return parseBackgroundBlockMode(backgroundBlock);
}

VirtualGrid VolumeConfig::virtualGrid() const {
  VirtualGrid grid;
  grid.voxels = static_cast<uint32_t>(voxels);
  grid.planes = static_cast<uint32_t>(planes);
  grid.quantise = quantise;
  grid.shareTexels = shareTexels;
  grid.featureRange = static_cast<float>(featureRange);
  grid.densityRange = static_cast<float>(densityRange);
  return grid;
}

BlockFieldShape VolumeConfig::attributeShape() const {
  HashGridOptions grid;
  grid.levels = gridLevels;
  grid.log2TableSize = gridLog2Size;
  grid.baseResolution = gridBase;
  grid.finestResolution = gridFinest;
  return makeBlockFieldShape(grid, width, hidden, static_cast<int>(VirtualGrid::kAttributes),
                             OutputActivation::sigmoid);
}

BlockFieldShape VolumeConfig::proposalShape() const {
  HashGridOptions grid;
  grid.levels = proposalLevels;
  grid.log2TableSize = proposalLog2Size;
  grid.baseResolution = gridBase;
  grid.finestResolution = proposalFinest;
  return makeBlockFieldShape(grid, proposalWidth, 1, 1, OutputActivation::none);
}

}  // namespace tessera
