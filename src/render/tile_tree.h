// The tiles of a scene as a renderer needs them: where they are, how coarse. Plain data, made from
// the tileset on disk; lengths in scene units (render/volume_frame.h).
#pragma once

#include <vector>

#include "scene/axes.h"

namespace tessera {

struct TileNode {
  int parent = -1;
  // Their boxes are cells of a grid on the ground, whose columns and rows may differ in width; cells may be missing.
  std::vector<int> children;
  Vec3d low = Vec3d::Zero(), high = Vec3d::Zero();  // box
  double geometricError = 0;                        // of its content: a texel of the planes
  int level = 0;                                    // 0 is the finest
  bool hasContent = true;                           // without: its children's stand for it; a leaf is empty
};

struct TileTree {
  std::vector<TileNode> tiles;  // the root first, parents before their children
  int surround = -1;            // one of `tiles` that stands outside the tree, if there is one

  // In an order that is front to back for every ray from `eye`: by the distance of their columns and rows from the
  // eye's (clamped), |di| + |dj|, which grows along any ray.
  std::vector<int> childrenFrontToBack(int tile, const Vec3d& eye) const;
  // The topmost contents: they cover all that the scene covers, and always stay in memory.
  std::vector<int> coarsest() const;
  // Aborts where the tree is not as said above.
  void check() const;
};

}  // namespace tessera
