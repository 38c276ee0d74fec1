// Levels of detail (City-on-Web, section 4.4): which blocks are merged into one model at which level.
#pragma once

#include <cstdint>
#include <vector>

#include "tiles/tileset.h"

namespace tessera {

// Level 0 is the blocks themselves. Each next one merges 2 × 2 groups, and all there are when no more than kMostMerged
// remain: 24 blocks come to 6 and then to 1, as in the paper.
inline constexpr uint32_t kMostMerged = 8;

// The level at which all is one; 0 for a single block. Where one tile cannot hold as many blocks
// (ContentLimits::parts), the highest level whose tiles can.
uint32_t topLevel(uint32_t columns, uint32_t rows);

struct LevelGroups {
  std::vector<uint32_t> groupOfBlock;  // [blocks]; a surround, the last block, is always a group of its own, the last
  std::vector<CellRange> cells;        // [groups], without the surround's

  uint32_t groups() const { return groupOfBlock.empty() ? 0 : groupOfBlock.back() + 1; }
};
LevelGroups groupsOfLevel(uint32_t columns, uint32_t rows, uint32_t level, bool withSurround);

}  // namespace tessera
