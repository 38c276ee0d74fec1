// Levels of detail (City-on-Web, section 4.4): which blocks are merged into one model at each level.
#pragma once

#include <cstdint>
#include <vector>

#include "tiles/tileset.h"

namespace tessera {

// Level 0 consists of the blocks themselves. Each coarser level merges 2 × 2 groups, or all groups if no more than
// kMaxMerged remain: 24 blocks become 6 and then 1, as in the paper.
inline constexpr uint32_t kMaxMerged = 8;

// Returns the level at which all blocks are merged into one; 0 for a single block. If that would be more than
// `maxBlocks`, returns the highest level whose groups have at most so many.
uint32_t topLevel(uint32_t columns, uint32_t rows, uint32_t maxBlocks);

struct LevelGroups {
  // [blocks]: the background block, which is the last block, always forms the last group on its own.
  std::vector<uint32_t> groupOfBlock;
  std::vector<CellRange> cells;  // [groups], without the background block's group

  uint32_t groups() const { return groupOfBlock.empty() ? 0 : groupOfBlock.back() + 1; }
};
LevelGroups groupsOfLevel(uint32_t columns, uint32_t rows, uint32_t level, bool withBackgroundBlock);

}  // namespace tessera
