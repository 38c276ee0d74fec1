#include "representations/mesh/train/config.h"

#include <algorithm>
#include <cmath>

namespace tessera {

MeshConfig::MeshConfig() {
  setOwnDefaults(fields());
}

std::vector<ConfigField> MeshConfig::fields() {
  return {
      roiMarginSetting(),
      coarseStepsSetting(),
      gridLevelsSetting().byDefault(16).within(1, 128 / std::max(1, gridFeatures)),
      gridFeaturesSetting(),
      gridLog2SizeSetting(),
      gridBaseSetting(),
      gridFinestSetting().byDefault(1024),
      widthSetting(),
      hiddenSetting(),
      meshCellsSetting(),
      everyCellSetting(),
      opacityOffsetSetting(),
      seedSetting(),
      samplesPerStepSetting(),
      firstRaysSetting(),
      maxRaysSetting(),
      photoBudgetMiBSetting(),
      stepsPerPhotoSetting(),
      occupancyEverySetting(),
      occupancyWarmupStepsSetting(),
      occupancyDecaySetting(),
      learningRateSetting(),
      finalLearningRateFactorSetting(),
      constantLearningRateFractionSetting(),
      networkL2Setting(),
      vertexLearningRateSetting(),
      vertexStartStepsSetting(),
      minCosineSetting(),
      exposureLearningRateSetting(),
      lossSetting(),
      lossParameterSetting(),
      opaqueLossSetting(),
      distortionWeightSetting().byDefault(0.02),
      exposureSetting(),
      randomBackgroundSetting(),
  };
}

void MeshConfig::check() const {
  MeshConfig checked = *this;
  requireWithinBounds(checked.fields());
}

MeshFieldShape MeshConfig::shape() const {
  check();
  HashGridOptions options;
  options.levels = gridLevels;
  options.features = gridFeatures;
  options.log2TableSize = gridLog2Size;
  options.baseResolution = gridBase;
  options.finestResolution = gridFinest;
  return makeMeshFieldShape(options, width, hidden);
}

OctahedraGrid MeshConfig::grid() const {
  OctahedraGrid grid{static_cast<uint32_t>(meshCells),
                     everyCell ? OctahedraPlacement::all : OctahedraPlacement::checkerboard};
  const float half = 0.5f * static_cast<float>(meshCells);
  grid.gridFromScene = {half, 0, 0, half, 0, half, 0, half, 0, 0, half, half, 0, 0, 0, 1};
  return grid;
}

MarchSpace MeshConfig::space() const {
  MarchSpace space;
  space.contracted = false;
  space.gridResolution = meshCells;
  space.minStep = std::exp(static_cast<float>(opacityOffset));
  space.cone = 0;
  return space;
}

}  // namespace tessera
