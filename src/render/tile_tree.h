// The tiles of a scene as a renderer needs them: their boxes and errors. Plain data, made from the tileset on disk;
// lengths are in scene units (render/tile_frame.h).
#pragma once

#include <vector>

#include "scene/axes.h"

namespace tessera {

// Cells of the block grid: columns [i0, i1) and rows [j0, j1).
struct TileCells {
  int i0 = 0, j0 = 0, i1 = 1, j1 = 1;
};

struct TileNode {
  int parent = -1;
  // The children cover the same cells as their parent, each once, and lie on a grid: the column ranges of any two
  // children are either equal or disjoint, and so are their row ranges.
  std::vector<int> children;
  TileCells cells;                                  // the cells that the tile covers
  Vec3d low = Vec3d::Zero(), high = Vec3d::Zero();  // bounding box
  double geometricError = 0;                        // of its content: the size of its finest texel
  int level = 0;                                    // level of detail; 0 is the finest
  bool hasContent = true;  // if false, the contents of its children stand for it; a leaf without content is empty
  bool isBackgroundBlock = false;  // whether it covers what lies outside its box, which is the scene's
};

struct TileBox {
  Vec3d low, high;
};

struct TileTree {
  // Cell (i, j) covers x in [2i - columns, 2i + 2 - columns] and, likewise, y in [2j - rows, 2j + 2 - rows].
  int columns = 1, rows = 1;
  std::vector<TileNode> tiles;  // the root first, parents before their children
  // The coarsest background block, or -1. It is an element of `tiles` outside the tree; the next finer one is its only
  // child.
  int backgroundBlock = -1;

  // Returns the children in an order that is front to back for every ray from `eye`. They are sorted by the number of
  // cells between them and the cell of `eye` (clamped to the grid), summed over both axes; this number grows along any
  // ray.
  std::vector<int> childrenFrontToBack(int tile, const Vec3d& eye) const;
  // The topmost tiles with content, without the background block. They cover the whole scene and are always resident.
  std::vector<int> coarsest() const;
  // The box in which a content is drawn for a tile's cells: as high as the tile, and unbounded at the border of the
  // scene.
  TileBox boxOfCells(int tile) const;
  // For renderers that never draw them.
  void removeBackgroundBlocks();
  // Aborts if the tree violates the rules above.
  void check() const;
};

}  // namespace tessera
