#include "representations/mesh/train/trained_mesh.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/log.h"
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

fs::path shownFile(const fs::path& folder) {
  return folder / "shown.json";
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

std::vector<std::string> StoredMesh::findUnfinishedParts() const {
  const std::optional<std::vector<std::string>> shown = readShownParts(folder_);
  std::vector<std::string> unfinished;
  for (const MeshPart& part : makeMeshParts(grid_, config_.hasBackground())) {
    if (shown && std::find(shown->begin(), shown->end(), part.name) == shown->end()) continue;
    const std::optional<ModelManifest> manifest = partFolder(folder_, part).manifest();
    if (!manifest) {
      unfinished.push_back(part.name + " has not been trained");
    } else if (manifest->plannedSteps == 0) {
      unfinished.push_back(fmt::format("{} has been trained for {} steps", part.name, manifest->step));
    } else if (manifest->step < manifest->plannedSteps) {
      unfinished.push_back(
          fmt::format("{} has been trained for {} of {} steps", part.name, manifest->step, manifest->plannedSteps));
    }
  }
  return unfinished;
}

void StoredMesh::warnOfUnfinishedParts(const std::string& remedy) const {
  const std::vector<std::string> unfinished = findUnfinishedParts();
  if (unfinished.empty()) return;
  warn("{}: {}; these places are shown unfinished or empty; {}", folder_.string(), fmt::join(unfinished, ", "), remedy);
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
  stored.warnOfUnfinishedParts("go on with tessera train ... --resume");
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

void writeShownParts(const fs::path& folder, const std::vector<MeshPart>& parts) {
  nlohmann::json names = nlohmann::json::array();
  for (const MeshPart& part : parts) names.push_back(part.name);
  writeFileAtomically(shownFile(folder), nlohmann::json{{"parts", names}}.dump(2) + "\n");
}

std::optional<std::vector<std::string>> readShownParts(const fs::path& folder) {
  const fs::path file = shownFile(folder);
  if (!fs::exists(file)) return std::nullopt;
  const nlohmann::json names = nlohmann::json::parse(readTextFile(file), nullptr, false);
  const auto isName = [](const nlohmann::json& name) { return name.is_string(); };
  if (!names.is_object() || !names.contains("parts") || !names["parts"].is_array() ||
      !std::all_of(names["parts"].begin(), names["parts"].end(), isName)) {
    throw Error(file.string(), "parts", "is missing, or not a list of names", "go on with tessera train ... --resume");
  }
  return names["parts"].get<std::vector<std::string>>();
}

void writeMeshManifest(const fs::path& folder, const std::vector<MeshPart>& parts) {
  ModelManifest sum;
  sum.method = "mesh";
  // A manifest names files that exist. Those of parts are not named: if one is lost, the others remain usable.
  sum.files = {coarseFolder(folder).manifest() ? "coarse/manifest.json" : "blocks.json"};
  bool isPlanned = true;
  for (const MeshPart& part : parts) {
    const std::optional<ModelManifest> manifest = partFolder(folder, part).manifest();
    isPlanned = isPlanned && manifest && manifest->plannedSteps > 0;
    if (!manifest) continue;
    sum.step += manifest->step;
    sum.plannedSteps += manifest->plannedSteps;
  }
  if (!isPlanned) sum.plannedSteps = 0;
  ModelFolder(folder).writeManifest(sum);
}

}  // namespace tessera
