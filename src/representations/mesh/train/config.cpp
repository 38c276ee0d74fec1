#include "representations/mesh/train/config.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace tessera {

MeshConfig MeshConfig::ofPreset(const std::string& name) {
  MeshConfig config;
  config.preset = name;
  if (!isPaperPreset(name)) return config;
  config.backgroundBlock = "none";
  config.gridLog2Size = 19;
  config.gridFinest = 2048;
  config.hidden = 3;
  config.meshCells = 128;
  config.everyCell = true;
  config.coarseCells = config.surfaceStart = false;
  config.networkL2 = config.distortionWeight = config.throughShare = config.finalShare = config.droppedShare = 0;
  config.exposure = config.randomBackground = false;
  config.enoughPhotos = 0;
  config.patchTexels = 32;
  return config;
}

MeshConfig::MeshConfig() {
  setOwnDefaults(fields());
}

std::vector<ConfigField> MeshConfig::fields() {
  return {
      presetSetting(),
      backgroundBlockSetting(),
      coarseStepsSetting(),
      coarseShareSetting(),
      backgroundShareSetting(),
      transientSetting(),
      enoughPhotosSetting(),
      gridLevelsSetting().byDefault(16).within(1, 128 / std::max(1, gridFeatures)),
      gridFeaturesSetting(),
      gridLog2SizeSetting(),
      gridBaseSetting(),
      gridFinestSetting().byDefault(1024),
      widthSetting(),
      hiddenSetting(),
      meshCellsSetting(),
      backgroundCellsSetting(),
      meshLevelsSetting(),
      everyCellSetting(),
      quadsSetting(),
      opacityOffsetSetting(),
      nearSetting(),
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
      coarseCellsSetting(),
      surfaceStartSetting(),
      vertexStartStepsSetting(),
      minCosineSetting(),
      exposureLearningRateSetting(),
      lossSetting(),
      lossParameterSetting(),
      opaqueLossSetting(),
      throughShareSetting(),
      finalShareSetting(),
      fittedLevelsSetting(),
      droppedShareSetting(),
      dilationSetting(),
      patchTexelsSetting(),
      distortionWeightSetting(),
      depthWeightSetting().byDefault(1),
      depthToleranceSetting(),
      sparseDepthRayFractionSetting(),
      exposureSetting(),
      randomBackgroundSetting(),
  };
}

void MeshConfig::check() const {
  ofPreset(preset);
  MeshConfig checked = *this;
  requireWithinBounds(checked.fields());
  if (transient != "auto" && transient != "none")
    throw Error("--set transient=" + transient, "", "a mesh does not know this value", "use auto or none");
  if (backgroundBlock == "own" || backgroundBlock == "none") return;
  throw Error("--set background_block=" + backgroundBlock, "", "a mesh has no such background block",
              "use own or none");
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
  constexpr int kLeastCells = 8;  // so that half a cell is within the margin of a block
  int levels = 1;
  while (levels < meshLevels && meshCells % (4 << levels) == 0 && meshCells >> levels >= kLeastCells) ++levels;
  return static_cast<uint32_t>(levels);
}

int64_t MeshConfig::stepsBeforeFinalStage(int64_t plannedSteps) const {
  return plannedSteps - std::llround(static_cast<double>(plannedSteps) * finalShare);
}

OctahedraDomain MeshConfig::domain(const MeshPart& part, uint32_t level) const {
  return makeOctahedraDomain(part, static_cast<uint32_t>(part.isBackground() ? backgroundCells : meshCells) >> level,
                             everyCell || quads ? OctahedraPlacement::all : OctahedraPlacement::checkerboard);
}

}  // namespace tessera
