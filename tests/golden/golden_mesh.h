// Generates the scene that is committed in tests/golden/mesh. Contents overlap at the wall between blocks, and many
// patches are half transparent, so that rays composite several layers.
#pragma once

#include <nlohmann/json.hpp>

#include "golden/golden_landscape.h"
#include "representations/mesh/content/mesh_content.h"

namespace tessera::golden {

Scene<MeshContent> makeMeshScene();

// The checksums that every reader must compute: docs/tile-format.md, section 12.
struct MeshSums {
  uint64_t patches = 0, pairs = 0;
  ByteSums vertices, features, opacity;
};
MeshSums computeSums(const PatchSet& part);
nlohmann::ordered_json toJson(const MeshSums& sums);

}  // namespace tessera::golden
