#include "bake/levels.h"

#include <algorithm>

namespace tessera {
namespace {

struct Steps {  // cells of a group along each axis
  uint32_t x = 1, y = 1;
};

uint32_t groupsAlong(uint32_t cells, uint32_t step) {
  return (cells + step - 1) / step;
}

Steps stepsOfLevel(uint32_t columns, uint32_t rows, uint32_t level) {
  Steps steps;
  for (uint32_t l = 0; l < level; ++l) {
    if (l > 0 && groupsAlong(columns, steps.x) * groupsAlong(rows, steps.y) <= kMaxMerged) return {columns, rows};
    steps = {std::min(2 * steps.x, columns), std::min(2 * steps.y, rows)};
  }
  return steps;
}

}  // namespace

uint32_t topLevel(uint32_t columns, uint32_t rows, uint32_t maxBlocks) {
  for (uint32_t level = 0;; ++level) {
    const Steps steps = stepsOfLevel(columns, rows, level), next = stepsOfLevel(columns, rows, level + 1);
    if (groupsAlong(columns, steps.x) * groupsAlong(rows, steps.y) == 1) return level;
    if (next.x * next.y > maxBlocks) return level;
  }
}

LevelGroups groupsOfLevel(uint32_t columns, uint32_t rows, uint32_t level, bool withBackgroundBlock) {
  const Steps steps = stepsOfLevel(columns, rows, level);
  const uint32_t across = groupsAlong(columns, steps.x), along = groupsAlong(rows, steps.y);
  LevelGroups groups;
  for (uint32_t j = 0; j < rows; ++j) {
    for (uint32_t i = 0; i < columns; ++i) groups.groupOfBlock.push_back(i / steps.x + across * (j / steps.y));
  }
  for (uint32_t j = 0; j < along; ++j) {
    for (uint32_t i = 0; i < across; ++i) {
      groups.cells.push_back(
          {{i * steps.x, j * steps.y}, {std::min((i + 1) * steps.x, columns), std::min((j + 1) * steps.y, rows)}});
    }
  }
  if (withBackgroundBlock) groups.groupOfBlock.push_back(across * along);
  return groups;
}

}  // namespace tessera
