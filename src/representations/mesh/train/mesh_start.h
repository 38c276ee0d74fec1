// Where the training of a mesh starts: a coarse field of the whole capture says which cells may hold a surface, and
// which pixels of the photos show one that lies in the region of interest.
#pragma once

#include "representations/field/train/field_model.h"
#include "representations/mesh/train/config.h"
#include "train/photo_tiles.h"

namespace tessera {

struct MeshStart {
  std::vector<bool> cells;        // [cells of the grid]
  std::vector<TileShares> tiles;  // [photo]; only training photos have some
};

// Throws Error if no training photo shows a surface in the region. `coarse` has the frame of the mesh.
MeshStart findMeshStart(const Capture& capture, FieldModel& coarse, const MeshConfig& config);

}  // namespace tessera
