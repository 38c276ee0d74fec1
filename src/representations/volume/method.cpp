#include "representations/volume/method.h"

#include <algorithm>

#include "representations/volume/bake/bake_volume.h"
#include "representations/volume/train/train_volume.h"
#include "representations/volume/train/volume_model_renderer.h"

namespace tessera {
namespace {

TrainingResult train(Device& device, const Capture& capture, const fs::path& model, const MethodSettings& settings,
                     const BlockRunOptions& options) {
  return trainVolume(device, capture, model, {options, SettingsOf<VolumeConfig>::in(settings)});
}

BlockDemand blockDemand(const MethodSettings& settings, const BlockRunOptions& options) {
  return volumeBlockDemand(SettingsOf<VolumeConfig>::in(settings), options);
}

// Opens the model with a renderer that culls as baking would at the current step.
std::unique_ptr<OpenedModel> openModel(Device& device, const fs::path& folder) {
  auto model = loadVolumeModel(device, folder);
  const ModelManifest manifest = requireManifest(ModelFolder(folder));
  // As in training, an unknown number of steps counts as the beginning.
  const double progress =
      manifest.plannedSteps == 0 ? 0 : static_cast<double>(manifest.step) / static_cast<double>(manifest.plannedSteps);
  auto renderer = std::make_unique<VolumeModelRenderer>(*model, cullThreshold(model->config(), progress));
  return std::make_unique<ModelWithRenderer<VolumeModel, VolumeModelRenderer>>(std::move(model), std::move(renderer));
}

constexpr std::string_view kResidentBlocks = "resident_blocks";
constexpr BakeParameter kBakeParameters[] = {
    {.name = kResidentBlocks,
     .help =
         "blocks of the model in memory at once, besides a background block of its own; 0: all; default: as many as in "
         "training",
     .minimum = 0,
     .maximum = 1 << 20}};

std::unique_ptr<Baker> openBaker(Device& device, const fs::path& folder, const BakeParameters& parameters) {
  const auto given = parameters.find(kResidentBlocks);
  const uint32_t resident = static_cast<uint32_t>(
      given != parameters.end() ? given->second : savedConfig<VolumeConfig>(folder).residentBlocks);
  const LevelModels models = [&device, folder, resident](uint32_t level) {
    return loadVolumeModel(device, levelFolder(folder, level), resident);
  };
  return makeVolumeBaker(models, trainedLevels<VolumeConfig>(folder));
}

std::vector<std::pair<std::string, uint64_t>> describe(const MethodSettings& settings) {
  const VolumeConfig& config = SettingsOf<VolumeConfig>::in(settings);
  const BlockFieldShape attributes = config.attributeShape(), proposals = config.proposalShape();
  return {{"parameters_per_block", attributes.grid.parameters() + attributes.network.parameters() +
                                       proposals.grid.parameters() + proposals.network.parameters()}};
}

}  // namespace

const Method& volumeMethod() {
  static const Method kMethod = {
      .name = "volume",
      .summary = "texels of blocks in sparse voxels and planes, shaded once a pixel (City-on-Web, MERF)",
      .trainsInBlocks = true,
      .swapsBlocks = true,
      .costs = {0.084, 40000, 8, 8, 5, int64_t{700} << 20, 120000000, 0, 0.175},
      .settings = makeSettings<VolumeConfig>,
      .train = train,
      .blockDemand = blockDemand,
      .openModel = openModel,
      .openBaker = openBaker,
      .bakeParameters = kBakeParameters,
      .describe = describe,
  };
  return kMethod;
}

}  // namespace tessera
