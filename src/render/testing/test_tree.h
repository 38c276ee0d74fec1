// For tests: trees over square cells of edge 2, centred at the origin.
#pragma once

#include <cmath>
#include <map>

#include "render/tile_tree.h"

namespace tessera {

// Each level merges 2×2 cells into one. Columns and rows need not be powers of two: tiles at the border then have fewer
// children.
inline TileTree testTree(int columns, int rows) {
  int levels = 0;
  while ((1 << levels) < std::max(columns, rows)) ++levels;
  TileTree tree;
  tree.columns = columns;
  tree.rows = rows;
  std::map<std::pair<int, int>, int> above;  // tiles of the level above, by column and row
  for (int level = levels; level >= 0; --level) {
    std::map<std::pair<int, int>, int> here;
    const int edge = 1 << level;
    for (int j = 0; j * edge < rows; ++j) {
      for (int i = 0; i * edge < columns; ++i) {
        TileNode node;
        node.level = level;
        node.cells = {i * edge, j * edge, std::min(columns, (i + 1) * edge), std::min(rows, (j + 1) * edge)};
        node.low = Vec3d(2 * node.cells.i0 - columns, 2 * node.cells.j0 - rows, -1);
        node.high = Vec3d(2 * node.cells.i1 - columns, 2 * node.cells.j1 - rows, 1);
        node.geometricError = 2.0 / 512 * edge;
        const int number = static_cast<int>(tree.tiles.size());
        if (level < levels) {
          node.parent = above.at({i / 2, j / 2});
          tree.tiles[node.parent].children.push_back(number);
        }
        tree.tiles.push_back(node);
        here[{i, j}] = number;
      }
    }
    above = here;
  }
  return tree;
}

}  // namespace tessera
