// The block grid as JSON: part of a model's blocks.json.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "scene/block_grid.h"

namespace tessera {

// {"origin": [x, y, z], "grid_from_world": [9 numbers, by rows], "edge", "columns", "rows", "bottom", "top"}. Numbers
// come back with every bit.
nlohmann::json blockGridToJson(const BlockGrid& grid);

// Nothing unless it is a grid that BlockGrid's comments allow: places and lengths within kFarthest, a rotation, at most
// so many cells, bottom below top.
inline constexpr int kMostBlocks = 1 << 16, kMostAlong = 1 << 12;  // in all, and along each side
std::optional<BlockGrid> blockGridFromJson(const nlohmann::json& value);

}  // namespace tessera
