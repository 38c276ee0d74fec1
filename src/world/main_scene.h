// The main scene of a world: the first one without a placement, whose capture defines the world's frame.
#pragma once

#include <optional>

#include "world/world_file.h"

namespace tessera {

// Returns its number.
size_t findMainScene(const World& world);

// Returns the transform from the world to the coordinates of the main scene's source (tiles/tileset.h). Returns nothing
// if that scene is invisible and not there, because the rest of such a world can be shown all the same. Throws Error as
// resolveScene and readTileset do.
std::optional<Mat4d> readSourceFromWorld(const World& world, const fs::path& worldFile);

}  // namespace tessera
