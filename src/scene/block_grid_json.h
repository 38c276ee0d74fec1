// Reads and writes a block grid as JSON. It is part of a model's blocks.json.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "scene/block_grid.h"

namespace tessera {

// Returns {"origin": [x, y, z], "grid_from_world": [9 numbers, by rows], "edge", "columns", "rows", "bottom", "top"}.
// Numbers are read back bit for bit.
nlohmann::json blockGridToJson(const BlockGrid& grid);

// Returns nothing unless the value is a valid BlockGrid: coordinates and lengths within kFarthest, a rotation, at most
// kMaxBlocks cells and kMaxAlong along each side, bottom below top and at most `edge` apart.
inline constexpr int kMaxBlocks = 1 << 16, kMaxAlong = 1 << 12;
std::optional<BlockGrid> blockGridFromJson(const nlohmann::json& value);

}  // namespace tessera
