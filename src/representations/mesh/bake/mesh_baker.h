// Bakes a trained mesh to the contents of a scene.
#pragma once

#include <memory>

#include "bake/baker.h"
#include "representations/mesh/bake/bake_mesh.h"
#include "representations/mesh/train/trained_mesh.h"

namespace tessera {

inline constexpr uint32_t kMaxTilesPerBlock = 16;
inline constexpr uint32_t kMinBakedPatchEdge = 8;  // of what is not coarser than it has been trained

struct MeshSceneSettings {
  uint32_t patchEdge = 0;      // texels along the edge of a patch: 8 to 32, a multiple of 4; 0: as trained
  uint32_t tilesPerBlock = 0;  // along an edge, at the finest level: a power of two; 0: one for each 32 cells,
                               // rounded down to a power of two
  bool fallback = true;        // contents have ordinary meshes for other programs
  bool inferredMaps = false;   // contents of blocks have their block's encoder instead of textures, which it gives
};

// The baker has one part of the mesh in memory at a time, and the contents that wait for more of them.
std::unique_ptr<Baker> makeMeshBaker(StoredMesh mesh, const MeshSceneSettings& settings);

}  // namespace tessera
