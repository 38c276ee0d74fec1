#include "render/tile_tree.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace tessera {
namespace {

int cellAt(double x, int count) {
  return static_cast<int>(std::clamp(std::floor(0.5 * (x + count)), 0.0, count - 1.0));
}

// Returns the number of cells between `cell` and the range [first, end).
int between(int cell, int first, int end) {
  return std::max({0, first - cell, cell - end + 1});
}

}  // namespace

std::vector<int> TileTree::childrenFrontToBack(int tile, const Vec3d& eye) const {
  const int i = cellAt(eye.x(), columns), j = cellAt(eye.y(), rows);
  std::vector<std::pair<int, int>> byDistance;
  for (const int child : tiles[tile].children) {
    const TileCells& cells = tiles[child].cells;
    byDistance.emplace_back(between(i, cells.i0, cells.i1) + between(j, cells.j0, cells.j1), child);
  }
  std::sort(byDistance.begin(), byDistance.end());
  std::vector<int> order;
  for (const auto& [distance, child] : byDistance) order.push_back(child);
  return order;
}

std::vector<int> TileTree::coarsest() const {
  std::vector<int> topmost;
  std::vector<char> covered(tiles.size());  // by the content of the tile or of an ancestor
  for (size_t i = 0; i < tiles.size(); ++i) {
    const TileNode& node = tiles[i];
    if (node.isBackgroundBlock) continue;
    const bool above = node.parent >= 0 && covered[node.parent];
    if (node.hasContent && !above) topmost.push_back(static_cast<int>(i));
    covered[i] = above || node.hasContent;
  }
  return topmost;
}

TileBox TileTree::boxOfCells(int tile) const {
  const TileCells& cells = tiles[tile].cells;
  const auto wall = [](int cell, int count, double outside) {
    return cell == 0 || cell == count ? outside : 2.0 * cell - count;
  };
  return {Vec3d(wall(cells.i0, columns, -INFINITY), wall(cells.j0, rows, -INFINITY), -INFINITY),
          Vec3d(wall(cells.i1, columns, INFINITY), wall(cells.j1, rows, INFINITY), INFINITY)};
}

void TileTree::removeBackgroundBlocks() {
  while (!tiles.empty() && tiles.back().isBackgroundBlock) tiles.pop_back();  // they come last
  backgroundBlock = -1;
}

void TileTree::check() const {
  CHECK(tiles.empty() == false);
  CHECK(backgroundBlock < static_cast<int>(tiles.size()));
  CHECK((backgroundBlock < 0 || tiles[backgroundBlock].isBackgroundBlock) == true);
  for (size_t i = 0; i < tiles.size(); ++i) {
    const TileNode& node = tiles[i];
    CHECK(node.parent < static_cast<int>(i));
    CHECK((node.parent >= 0 || i == 0 || static_cast<int>(i) == backgroundBlock) == true);
    for (const int child : node.children) {
      CHECK(child > static_cast<int>(i));
      CHECK(child < static_cast<int>(tiles.size()));
      CHECK(tiles[child].parent == static_cast<int>(i));
    }
  }
}

}  // namespace tessera
