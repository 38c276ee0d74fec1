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

struct TrainedMesh {
  Device* device;
  BlockGrid grid;
  std::vector<std::unique_ptr<MeshModel>> parts;  // those that have been trained, the outside last
  fs::path folder;
};

// Loads a trained mesh for rendering. Throws Error if its files are missing or malformed, or if no part has been
// trained.
TrainedMesh loadTrainedMesh(Device& device, const fs::path& folder);

// Returns how well the blocks cover what their photos show. Reads the checkpoints of all parts, one at a time. Throws
// Error as loadTrainedMesh does, except if no part has been trained.
std::vector<SurfaceCoverage> readMeshCoverage(const fs::path& folder);

// Writes the manifest of the mesh, which sums up those of its parts. Throws Error if it cannot be written.
void writeMeshManifest(const fs::path& folder, const std::vector<MeshPart>& parts);

}  // namespace tessera
