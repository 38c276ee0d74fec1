// How many blocks a region is cut into, and where they lie.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "partition/heights.h"
#include "scene/block_grid.h"

namespace tessera {

// `--blocks`: so many along the region's x and y, or as many as suit it.
struct BlockCount {
  bool automatic = true;
  int columns = 1, rows = 1;
};

// "auto" or "3x2"; nothing for anything else, and for more than scene/block_grid_json.h allows.
std::optional<BlockCount> parseBlockCount(std::string_view text);

struct BlockLimits {
  int texelsPerEdge = 512;            // of a block's finest plane along its edge
  double bytesPerBlock = 128e6;       // while it is trained
  double memoryBudget = 4e9;          // bytes for all blocks
  double groundPixelsPerTexel = 1.5;  // no coarser than that, memory permitting
};

enum class DecidedBy {
  request,  // so many were asked for
  detail,   // texels as fine as the photos
  memory,   // as many as the budget holds
  height    // the scene is too high for smaller cells
};

struct BlockLayout {
  BlockGrid grid;
  DecidedBy decidedBy = DecidedBy::request;
  std::string how;  // for people: what decided, and what it came to
};

// Cells are squares of edge max(width / columns, depth / rows), the region in their middle, their sides along its own;
// the grid's origin is half-way up the heights. Cells are never less wide than the scene is high (a block is a cube):
// a count that was asked for then stays, and the cells reach beyond the region.
BlockLayout layOutBlocks(const Ground& ground, const Region& region, const Heights& heights, const BlockCount& count,
                         const BlockLimits& limits);

}  // namespace tessera
