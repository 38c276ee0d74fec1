// The number of blocks that a region is divided into, and their position.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "partition/heights.h"
#include "scene/block_grid.h"

namespace tessera {

// The value of `--blocks`: the number of blocks along the region's x and y, or an automatic choice.
struct BlockCount {
  bool automatic = true;
  int columns = 1, rows = 1;
};

// Parses "auto" or a count such as "3x2". Returns nothing for any other text, and for more blocks than
// scene/block_grid_json.h allows.
std::optional<BlockCount> parseBlockCount(std::string_view text);

struct BlockLimits {
  int texelsPerEdge = 512;            // of a block's finest plane along its edge
  double bytesPerBlock = 128e6;       // during training
  double memoryBudget = 4e9;          // bytes for all blocks
  double groundPixelsPerTexel = 1.5;  // maximum size of a texel, if the memory budget permits it
};

enum class DecidedBy {
  request,  // the number was requested
  detail,   // the texels are as fine as the photos
  memory,   // the memory budget allows no more blocks
  height    // the scene is too high for smaller cells
};

struct BlockLayout {
  BlockGrid grid;
  DecidedBy decidedBy = DecidedBy::request;
  std::string how;  // for log messages: the deciding factor and the result
};

// Returns a grid centred on the region and aligned with its sides. Cells are squares of edge
// max(width / columns, depth / rows); the grid's origin is midway between the bottom and top heights. Because a block
// is a cube, cells are never narrower than the scene is high: a requested number of blocks is respected even then, and
// the cells extend beyond the region.
BlockLayout layOutBlocks(const Ground& ground, const Region& region, const Heights& heights, const BlockCount& count,
                         const BlockLimits& limits);

}  // namespace tessera
