#include "representations/mesh/method.h"

#include "representations/mesh/train/mesh_renderer.h"
#include "representations/mesh/train/train_mesh.h"

namespace tessera {
namespace {

TrainingResult train(Device& device, const Capture& capture, const fs::path& model, const MethodSettings& settings,
                     const BlockRunOptions& options) {
  return trainMesh(device, capture, model, {options, SettingsOf<MeshConfig>::in(settings)});
}

std::unique_ptr<OpenedModel> openModel(Device& device, const fs::path& folder) {
  auto mesh = std::make_unique<TrainedMesh>(loadTrainedMesh(device, folder));
  auto renderer = std::make_unique<MeshRenderer>(*mesh);
  return std::make_unique<ModelWithRenderer<TrainedMesh, MeshRenderer>>(std::move(mesh), std::move(renderer));
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
      .settings = makeSettings<MeshConfig>,
      .train = train,
      .openModel = openModel,
      .describe = describe,
  };
  return kMethod;
}

}  // namespace tessera
