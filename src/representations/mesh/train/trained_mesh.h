// A trained mesh in its folder: settings and blocks in the folder itself, the coarse field in `coarse`, and each part
// in a model folder of its own in `parts`.
#pragma once

#include <memory>
#include <vector>

#include "representations/mesh/train/mesh_model.h"
#include "train/model_folder.h"

namespace tessera {

inline ModelFolder coarseFolder(const fs::path& mesh) {
  return ModelFolder(mesh / "coarse");
}
inline ModelFolder partFolder(const fs::path& mesh, const MeshPart& part) {
  return ModelFolder(mesh / "parts" / part.name);
}

// A trained mesh whose parts are read when they are needed: those of a large place do not fit the memory together.
class StoredMesh {
 public:
  // A part that has been trained, as far as its checkpoint tells without being loaded.
  struct Part {
    MeshPart part;
    uint32_t levels = 1;
    bool hasAtlas = false;
    std::optional<SurfaceCoverage> coverage;  // MeshAtlas::coverage
  };

  // Reads the checkpoints, one at a time. Keeps a reference to `device`. Throws Error if files are missing or
  // malformed, or if no part has been trained.
  StoredMesh(Device& device, const fs::path& folder);

  Device& device() const { return *device_; }
  const fs::path& folder() const { return folder_; }
  const MeshConfig& config() const { return config_; }
  const BlockGrid& grid() const { return grid_; }
  const std::vector<Part>& parts() const { return parts_; }  // the outside last
  // What is left to train, in words: the parts that photos show, and that have not been trained to their end. Throws
  // Error if shown.json is malformed.
  std::vector<std::string> findUnfinishedParts() const;
  // Warns of them, with a remedy. Throws Error as findUnfinishedParts does.
  void warnOfUnfinishedParts(const std::string& remedy) const;

  // Loads a part. Throws Error if its checkpoint is missing or malformed.
  std::unique_ptr<MeshModel> load(const MeshPart& part, MeshUse use) const;

 private:
  Device* device_;
  fs::path folder_;
  MeshConfig config_;
  BlockGrid grid_;
  std::vector<Part> parts_;
};

// A trained mesh for rendering, all parts of which are in memory.
struct TrainedMesh {
  Device* device;
  BlockGrid grid;
  std::vector<std::unique_ptr<MeshModel>> parts;  // those that have been trained, the outside last
};

// Warns of unfinished parts. Throws Error as StoredMesh does.
TrainedMesh loadTrainedMesh(Device& device, const fs::path& folder);

// Returns how well the blocks cover what their photos show. Reads the checkpoints of all parts, one at a time. Throws
// Error as loadTrainedMesh does, except if no part has been trained.
std::vector<SurfaceCoverage> readMeshCoverage(const fs::path& folder);

// Writes the manifest of the mesh, which sums up those of these parts. Throws Error if it cannot be written.
void writeMeshManifest(const fs::path& folder, const std::vector<MeshPart>& parts);

// Write and read shown.json: the parts that photos show something of. The others are never trained and have no
// triangles. Reading returns nothing before the first part is trained. Throw Error if the file cannot be written, or is
// malformed.
void writeShownParts(const fs::path& folder, const std::vector<MeshPart>& parts);
std::optional<std::vector<std::string>> readShownParts(const fs::path& folder);

}  // namespace tessera
