// For tests: a tile tree without levels of detail.
#pragma once

#include <cmath>
#include <vector>

#include "render/tile_tree.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

// Returns a tree for contents side by side, without levels: a root tile without content, one child tile for each
// content in their order, and last, optionally, a tile for the background block. The boxes of the tiles are what their
// parts own and must be cells of edge 2 around the origin.
inline TileTree flatTileTree(const std::vector<VolumeContent>& contents, bool withBackgroundBlock = false) {
  TileTree tree;
  TileNode root;
  root.hasContent = false;
  root.level = 1;
  root.low = Vec3d::Constant(INFINITY);
  root.high = Vec3d::Constant(-INFINITY);
  tree.tiles.push_back(root);
  for (const VolumeContent& content : contents) {
    TileNode node;
    node.parent = 0;
    node.low = Vec3d::Constant(INFINITY);
    node.high = Vec3d::Constant(-INFINITY);
    for (const VolumePart& part : content.parts) {
      node.low = node.low.cwiseMin(Eigen::Map<const Vec3f>(part.low.data()).cast<double>());
      node.high = node.high.cwiseMax(Eigen::Map<const Vec3f>(part.high.data()).cast<double>());
    }
    tree.tiles[0].low = tree.tiles[0].low.cwiseMin(node.low);
    tree.tiles[0].high = tree.tiles[0].high.cwiseMax(node.high);
    tree.tiles[0].children.push_back(static_cast<int>(tree.tiles.size()));
    tree.tiles.push_back(node);
  }
  TileNode& whole = tree.tiles[0];
  tree.columns = static_cast<int>(std::lround(0.5 * (whole.high.x() - whole.low.x())));
  tree.rows = static_cast<int>(std::lround(0.5 * (whole.high.y() - whole.low.y())));
  for (TileNode& node : tree.tiles) {
    const auto cell = [](double x, double from) { return static_cast<int>(std::lround(0.5 * (x - from))); };
    node.cells = {cell(node.low.x(), whole.low.x()), cell(node.low.y(), whole.low.y()),
                  cell(node.high.x(), whole.low.x()), cell(node.high.y(), whole.low.y())};
  }
  if (withBackgroundBlock) {
    tree.backgroundBlock = static_cast<int>(tree.tiles.size());
    tree.tiles.emplace_back().isBackgroundBlock = true;
  }
  return tree;
}

}  // namespace tessera
