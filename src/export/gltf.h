// `tessera export --format gltf`: exports a level of detail of a `mesh` scene as ordinary triangles with base colour
// textures, the meshes that its contents have for other programs (representations/mesh/content/fallback_mesh.h).
#pragma once

#include "base/file.h"

namespace tessera {

struct GltfExportSettings {
  uint32_t level = 0;    // of detail; 0 is the finest
  bool isSplit = false;  // one file for each tile, in a folder
};

struct GltfExport {
  uint64_t bytesOnDisk = 0, triangles = 0;
  uint32_t files = 0, tiles = 0;  // tiles with triangles, with the background block
};

// Writes the file `out`, which must end in .glb, or the folder `out`; each appears complete or not at all, and may
// replace an older export. Units are those of the tile frame (tiles/tileset.h), which are metres if the scene is
// georeferenced. Axes are glTF's: x is east, y up and z south (right-handed); the origin is the tile frame's, whose
// latitude, longitude and altitude are in the `extras` of the glTF scene. One content is in memory at a time. Throws
// Error unless `scene` is a scene of mesh with ordinary meshes and this level.
GltfExport exportGltf(const fs::path& scene, const fs::path& out, const GltfExportSettings& settings = {});

}  // namespace tessera
