// The tiles of a scene as a renderer needs them: where they are, how coarse. Plain data, made from the tileset on disk;
// lengths in scene units (render/tile_frame.h).
#pragma once

#include <vector>

#include "scene/axes.h"

namespace tessera {

// Cells of the block grid: columns i0 to before i1, rows j0 to before j1.
struct TileCells {
  int i0 = 0, j0 = 0, i1 = 1, j1 = 1;
};

struct TileNode {
  int parent = -1;
  // They stand for the same cells, each once, and lie on a grid: of two of them, the ranges of columns are the same or
  // apart, and so are those of rows.
  std::vector<int> children;
  TileCells cells;                                  // what it stands for
  Vec3d low = Vec3d::Zero(), high = Vec3d::Zero();  // box
  double geometricError = 0;                        // of its content: its finest texel
  int level = 0;                                    // 0 is the finest
  bool hasContent = true;                           // without: its children's stand for it; a leaf is empty
  bool isSurround = false;                          // stands for what is outside of its box, the scene's
};

struct TileBox {
  Vec3d low, high;
};

struct TileTree {
  // Cell (i, j) holds x in [2i - columns, 2i + 2 - columns], y likewise.
  int columns = 1, rows = 1;
  std::vector<TileNode> tiles;  // the root first, parents before their children
  // One of `tiles` that stands outside the tree, if there is one: the coarsest. The next finer one is its only child.
  int surround = -1;

  // In an order that is front to back for every ray from `eye`: by the number of cells between theirs and the eye's
  // (clamped), along both axes together, which grows along any ray.
  std::vector<int> childrenFrontToBack(int tile, const Vec3d& eye) const;
  // The topmost contents, the surround apart: they cover all that the scene covers, and always stay in memory.
  std::vector<int> coarsest() const;
  // What is drawn of a content in a tile's cells: to its height, and beyond the scene's box at the border.
  TileBox boxOfCells(int tile) const;
  // Aborts where the tree is not as said above.
  void check() const;
};

}  // namespace tessera
