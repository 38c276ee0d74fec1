#include "representations/mesh/train/config.h"

#include <algorithm>

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
      meshLevelsSetting(),
      everyCellSetting(),
      opacityOffsetSetting(),
      nearSetting().within(0, ConfigBounds::kHuge),
      seedSetting(),
      samplesPerStepSetting(),
      firstRaysSetting(),
      maxRaysSetting(),
      photoBudgetMiBSetting(),
      stepsPerPhotoSetting(),
      occupancyEverySetting(),
      occupancyStartStepsSetting(),
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

uint32_t MeshConfig::levels() const {
  int levels = 1;
  while (levels < meshLevels && meshCells % (4 << levels) == 0) ++levels;
  return static_cast<uint32_t>(levels);
}

OctahedraGrid MeshConfig::grid(uint32_t level) const {
  OctahedraGrid grid{static_cast<uint32_t>(meshCells) >> level,
                     everyCell ? OctahedraPlacement::all : OctahedraPlacement::checkerboard};
  const float half = 0.5f * static_cast<float>(grid.resolution);
  grid.gridFromScene = {half, 0, 0, half, 0, half, 0, half, 0, 0, half, half, 0, 0, 0, 1};
  return grid;
}

}  // namespace tessera
