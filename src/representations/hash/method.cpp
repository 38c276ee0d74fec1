#include "representations/hash/method.h"

#include "representations/hash/bake/bake_hash.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/train/hash_model_renderer.h"
#include "representations/hash/train/train_hash.h"

namespace tessera {
namespace {

TrainingResult train(Device& device, const Capture& capture, const fs::path& model, const MethodSettings& settings,
                     const BlockRunOptions& options) {
  return trainHash(device, capture, model, {options, SettingsOf<HashConfig>::in(settings)});
}

BlockDemand blockDemand(const MethodSettings& settings, const BlockRunOptions& options) {
  return hashBlockDemand(SettingsOf<HashConfig>::in(settings), options);
}

std::unique_ptr<OpenedModel> openModel(Device& device, const fs::path& folder) {
  auto model = loadHashModel(device, folder);
  auto renderer = std::make_unique<HashModelRenderer>(*model);
  return std::make_unique<ModelWithRenderer<HashModel, HashModelRenderer>>(std::move(model), std::move(renderer));
}

constexpr std::string_view kCells = "cells", kDilation = "dilation";
constexpr BakeParameter kBakeParameters[] = {
    {.name = kCells,
     .help = "cells of a block's occupancy along an edge, a multiple of 8; 0: three times the lattice's, up to 384 or "
             "the lattice's",
     .minimum = 0,
     .maximum = kMaxOccupancyCells,
     .divisibleBy = HashPart::kOccupancyUnit,
     .standard = HashBakeSettings().cells},
    {.name = kDilation,
     .help = "number of layers of cells around the visible ones that are kept as well",
     .minimum = 0,
     .maximum = 8,
     .standard = HashBakeSettings().dilation}};

std::unique_ptr<Baker> openBaker(Device& device, const fs::path& folder, const BakeParameters& parameters) {
  HashBakeSettings settings;
  if (const auto cells = parameters.find(kCells); cells != parameters.end()) {
    settings.cells = static_cast<uint32_t>(cells->second);
  }
  if (const auto dilation = parameters.find(kDilation); dilation != parameters.end()) {
    settings.dilation = static_cast<int>(dilation->second);
  }
  const HashLevelModels models = [&device, folder](uint32_t level) {
    return loadHashModel(device, levelFolder(folder, level));
  };
  return makeHashBaker(models, trainedLevels<HashConfig>(folder), settings);
}

std::vector<std::pair<std::string, uint64_t>> describe(const MethodSettings& settings) {
  const HashConfig& config = SettingsOf<HashConfig>::in(settings);
  const BlockFieldShape coarse = config.coarseShape();
  return {
      {"parameters_per_block", coarse.grid.parameters() + coarse.network.parameters() + config.fineGrid().parameters()},
      {"multiply_accumulates_per_sample", config.multiplyAccumulates()},
      {"view_dependent_multiply_accumulates_per_ray", countMultiplyAccumulates(config.directionShape())}};
}

}  // namespace

const Method& hashMethod() {
  static const Method kMethod = {
      .name = "hash",
      .summary = "hash tables of blocks whose levels are weighed by attention, decoded once a pixel (NGP-RT)",
      .trainsInBlocks = true,
      .costs = {0.145, 15000, 10, 20, 10, int64_t{1300} << 20, 750000000},
      .settings = makeSettings<HashConfig>,
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
