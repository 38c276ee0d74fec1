#include "representations/mesh/train/trained_mesh.h"

#include "base/error.h"
#include "train/block_frame.h"
#include "train/run_folder.h"

namespace tessera {

namespace {

// Calls use(part, file, checkpoint) for the parts that have been trained, one at a time.
template <class Use>
void forEachCheckpoint(const fs::path& folder, const MeshConfig& config, const BlockGrid& grid, const Use& use) {
  for (const MeshPart& part : makeMeshParts(grid, config.hasBackground())) {
    const ModelFolder trained = partFolder(folder, part);
    const std::optional<ModelManifest> manifest = trained.manifest();
    if (!manifest) continue;
    const fs::path file = trained.root() / manifest->files.at(0);
    use(part, file, readSafetensors(file));
  }
}

}  // namespace

StoredMesh::StoredMesh(Device& device, const fs::path& folder) : device_(&device), folder_(folder) {
  const ModelFolder root(folder);
  requireManifest(root, "mesh");
  configFromToml(config_.fields(), root.configPath());
  grid_ = requireGrid(root);
  forEachCheckpoint(folder, config_, grid_,
                    [&](const MeshPart& part, const fs::path& file, const Safetensors& checkpoint) {
                      parts_.push_back({part, countLevels(config_, part, checkpoint), tessera::hasAtlas(checkpoint),
                                        readCoverage(part, file, checkpoint)});
                    });
  if (parts_.empty())
    throw Error(folder.string(), "parts", "none has been trained yet", "go on with tessera train ... --resume");
}

std::unique_ptr<MeshModel> StoredMesh::load(const MeshPart& part, MeshUse use) const {
  const ModelFolder trained = partFolder(folder_, part);
  const fs::path file = trained.root() / requireManifest(trained).files.at(0);
  auto model = std::make_unique<MeshModel>(*device_, config_, part, use);
  model->restore(file, readSafetensors(file));
  return model;
}

TrainedMesh loadTrainedMesh(Device& device, const fs::path& folder) {
  const StoredMesh stored(device, folder);
  TrainedMesh mesh{&device, stored.grid(), {}};
  for (const StoredMesh::Part& each : stored.parts()) mesh.parts.push_back(stored.load(each.part, MeshUse::rendering));
  return mesh;
}

std::vector<SurfaceCoverage> readMeshCoverage(const fs::path& folder) {
  const ModelFolder root(folder);
  requireManifest(root, "mesh");
  std::vector<SurfaceCoverage> coverage;
  forEachCheckpoint(folder, savedConfig<MeshConfig>(folder), requireGrid(root),
                    [&](const MeshPart& part, const fs::path& file, const Safetensors& checkpoint) {
                      if (const auto checked = readCoverage(part, file, checkpoint)) coverage.push_back(*checked);
                    });
  return coverage;
}

void writeMeshManifest(const fs::path& folder, const std::vector<MeshPart>& parts) {
  ModelManifest sum;
  sum.method = "mesh";
  // A manifest names files that exist.
  sum.files = {coarseFolder(folder).manifest() ? "coarse/manifest.json" : "blocks.json"};
  bool isPlanned = true;
  for (const MeshPart& part : parts) {
    const std::optional<ModelManifest> manifest = partFolder(folder, part).manifest();
    isPlanned = isPlanned && manifest && manifest->plannedSteps > 0;
    if (!manifest) continue;
    sum.step += manifest->step;
    sum.plannedSteps += manifest->plannedSteps;
    sum.files.push_back("parts/" + part.name + "/manifest.json");
  }
  if (!isPlanned) sum.plannedSteps = 0;
  ModelFolder(folder).writeManifest(sum);
}

}  // namespace tessera
