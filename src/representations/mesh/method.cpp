#include "representations/mesh/method.h"

#include <bit>

#include "base/error.h"
#include "representations/mesh/bake/mesh_baker.h"
#include "representations/mesh/train/mesh_renderer.h"
#include "representations/mesh/train/train_mesh.h"

namespace tessera {
namespace {

TrainingResult train(Device& device, const Capture& capture, const fs::path& model, const MethodSettings& settings,
                     const BlockRunOptions& options) {
  return trainMesh(device, capture, model, {options, SettingsOf<MeshConfig>::in(settings)});
}

BlockDemand blockDemand(const MethodSettings& settings, const BlockRunOptions&) {
  return meshBlockDemand(SettingsOf<MeshConfig>::in(settings));
}

std::unique_ptr<OpenedModel> openModel(Device& device, const fs::path& folder) {
  auto mesh = std::make_unique<TrainedMesh>(loadTrainedMesh(device, folder));
  auto renderer = std::make_unique<MeshRenderer>(*mesh);
  return std::make_unique<ModelWithRenderer<TrainedMesh, MeshRenderer>>(std::move(mesh), std::move(renderer));
}

constexpr std::string_view kTexels = "texels", kTilesPerBlock = "tiles_per_block", kFallback = "fallback",
                           kMaps = "maps";
constexpr std::string_view kMapChoices[] = {"stored", "inferred"};
constexpr BakeParameter kBakeParameters[] = {
    {.name = kTexels,
     .help = "texels along the edge of a patch of two triangles, 8 to 32; 0: as the model was trained with",
     .minimum = 0,
     .maximum = PatchSet::kMaxPatchEdge,
     .divisibleBy = 4,
     .standard = MeshSceneSettings().patchEdge},
    {.name = kTilesPerBlock,
     .help = "tiles along an edge of a block at the finest level: 1, 2, 4, 8 or 16; 0: one for each 32 cells",
     .minimum = 0,
     .maximum = kMaxTilesPerBlock,
     .standard = MeshSceneSettings().tilesPerBlock},
    {.name = kFallback,
     .help = "1: with ordinary textured meshes, for programs that know only glTF; 0: without",
     .minimum = 0,
     .maximum = 1,
     .standard = MeshSceneSettings().fallback ? 1 : 0},
    {.name = kMaps,
     .help = "stored: textures in the tiles; inferred: instead of them, the encoder of each block, from which viewers "
             "compute the same textures",
     .choices = kMapChoices,
     .maximum = 1,
     .standard = MeshSceneSettings().inferredMaps ? 1 : 0}};

std::unique_ptr<Baker> openBaker(Device& device, const fs::path& folder, const BakeParameters& parameters) {
  const auto value = [&](std::string_view name) { return static_cast<uint32_t>(parameters.at(std::string(name))); };
  MeshSceneSettings settings;
  settings.patchEdge = value(kTexels);
  settings.tilesPerBlock = value(kTilesPerBlock);
  settings.fallback = value(kFallback) != 0;
  settings.inferredMaps = value(kMaps) == 1;
  if (settings.patchEdge > 0 && settings.patchEdge < kMinBakedPatchEdge) {
    throw Error("--texels " + std::to_string(settings.patchEdge), "", "is less than baked patches have",
                "use 8 or more");
  }
  if (settings.tilesPerBlock > 0 && !std::has_single_bit(settings.tilesPerBlock)) {
    throw Error("--tiles-per-block " + std::to_string(settings.tilesPerBlock), "", "is not a power of two",
                "use 0, 1, 2, 4, 8 or 16");
  }
  return makeMeshBaker(StoredMesh(device, folder), settings);
}

std::vector<std::pair<std::string, uint64_t>> describe(const MethodSettings& settings) {
  const MeshConfig& config = SettingsOf<MeshConfig>::in(settings);
  const MeshFieldShape shape = config.shape();
  return {
      {"parameters_per_block", shape.grid.parameters() + shape.encoder.parameters() + shape.decoder.parameters()},
      {"vertices_per_block", uint64_t{static_cast<uint32_t>(config.meshCells)} * config.meshCells * config.meshCells},
      {"multiply_accumulates_per_sample", 8 * shape.grid.columns() + countMultiplyAccumulates(shape.encoder)},
      {"view_dependent_multiply_accumulates_per_sample", countMultiplyAccumulates(shape.decoder)}};
}

}  // namespace

const Method& meshMethod() {
  static const Method kMethod = {
      .name = "mesh",
      .summary = "triangles whose colours a small network decodes (UE4-NeRF)",
      .trainsInBlocks = true,
      .partsAlone = true,
      .costs = {0.06, 45000, 12, 1, 2, int64_t{1400} << 20, 600000000},
      .settings = makeSettings<MeshConfig>,
      .train = train,
      .blockDemand = blockDemand,
      .openModel = openModel,
      .openBaker = openBaker,
      .bakeParameters = kBakeParameters,
      .describe = describe,
      .readCoverage = readMeshCoverage,
  };
  return kMethod;
}

}  // namespace tessera
