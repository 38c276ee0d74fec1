#include "representations/field/train/config.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace tessera {

FieldConfig::FieldConfig() {
  setOwnDefaults(fields());
}

std::vector<ConfigField> FieldConfig::fields() {
  return {
      contractedSetting(),
      roiMarginSetting(),
      gridLevelsSetting().byDefault(16).within(1, 128 / std::max(1, gridFeatures)),
      gridFeaturesSetting(),
      gridLog2SizeSetting(),
      gridBaseSetting(),
      gridFinestSetting().byDefault(2048),
      widthSetting(),
      densityHiddenSetting(),
      colourHiddenSetting(),
      occupancyResolutionSetting(),
      nearSetting().within(0, ConfigBounds::kHuge),
      farSetting(),
      minStepSetting(),
      coneSetting(),
      seedSetting(),
      samplesPerStepSetting(),
      samplesPerMicroBatchSetting(),
      firstRaysSetting(),
      maxRaysSetting(),
      photoBudgetMiBSetting(),
      stepsPerPhotoSetting(),
      occupancyEverySetting(),
      occupancyWarmupStepsSetting(),
      occupancyUpdateFractionSetting(),
      learningRateSetting(),
      finalLearningRateFactorSetting(),
      constantLearningRateFractionSetting(),
      networkL2Setting(),
      tableL2Setting(),
      exposureLearningRateSetting(),
      lossSetting(),
      lossParameterSetting(),
      distortionWeightSetting(),
      depthWeightSetting(),
      depthToleranceSetting(),
      sparseDepthRayFractionSetting(),
      fullGradientDistanceSetting(),
      exposureSetting(),
      randomBackgroundSetting(),
  };
}

void FieldConfig::check() const {
  FieldConfig checked = *this;
  requireWithinBounds(checked.fields());
  const MarchSpace marched = space();
  const double steps = marched.stepIndex(marched.far) - marched.stepIndex(marched.near);
  if (!(steps <= kMaxSteps)) {
    throw Error(fmt::format("--set min_step={} cone={} far={}", minStep, cone, far), "",
                fmt::format("a ray from near to far would take {:.0f} steps", steps),
                fmt::format("use longer ones or a nearer far: at most {} steps", kMaxSteps));
  }
}

RadianceFieldShape FieldConfig::shape() const {
  check();
  HashGridOptions grid;
  grid.levels = gridLevels;
  grid.features = gridFeatures;
  grid.log2TableSize = gridLog2Size;
  grid.baseResolution = gridBase;
  grid.finestResolution = gridFinest;
  return makeRadianceFieldShape(grid, width, densityHidden, colourHidden);
}

MarchSpace FieldConfig::space() const {
  MarchSpace space;
  space.contracted = contracted;
  space.gridResolution = occupancyResolution;
  space.near = static_cast<float>(near);
  space.far = static_cast<float>(far);
  space.minStep = static_cast<float>(minStep);
  space.cone = static_cast<float>(cone);
  return space;
}

}  // namespace tessera
