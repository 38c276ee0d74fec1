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
      meshLevelsSetting().within(1, maxLevels()),
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

int MeshConfig::maxLevels() const {
  int levels = 1;  // the cells of the coarsest level along an edge must be a multiple of 4
  while (levels < 5 && (meshCells >> levels) % 4 == 0 && (meshCells >> levels) << levels == meshCells) ++levels;
  return levels;
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

OctahedraGrid MeshConfig::grid(uint32_t level) const {
  OctahedraGrid grid{static_cast<uint32_t>(meshCells) >> level,
                     everyCell ? OctahedraPlacement::all : OctahedraPlacement::checkerboard};
  const float half = 0.5f * static_cast<float>(grid.resolution);
  grid.gridFromScene = {half, 0, 0, half, 0, half, 0, half, 0, 0, half, half, 0, 0, 0, 1};
  return grid;
}

}  // namespace tessera
