#include "representations/mesh/train/trained_mesh.h"

#include "base/error.h"
#include "train/block_frame.h"
#include "train/run_folder.h"

namespace tessera {

TrainedMesh loadTrainedMesh(Device& device, const fs::path& folder) {
  const ModelFolder root(folder);
  requireManifest(root, "mesh");
  MeshConfig config;
  configFromToml(config.fields(), root.configPath());
  TrainedMesh mesh{&device, requireGrid(root), {}, folder};
  for (const MeshPart& part : makeMeshParts(mesh.grid, config.hasBackground())) {
    const ModelFolder trained = partFolder(folder, part);
    const std::optional<ModelManifest> manifest = trained.manifest();
    if (!manifest) continue;
    mesh.parts.push_back(std::make_unique<MeshModel>(device, config, part));
    const fs::path file = trained.root() / manifest->files.at(0);
    mesh.parts.back()->restore(file, readSafetensors(file));
  }
  if (mesh.parts.empty())
    throw Error(folder.string(), "parts", "none has been trained yet", "go on with tessera train ... --resume");
  return mesh;
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
