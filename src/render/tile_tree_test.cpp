#include "render/tile_tree.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/random.h"
#include "render/testing/test_tree.h"
#include "render/tile_frame.h"

namespace tessera {
namespace {

// Collects all leaves below a tile, in the tree's front-to-back order.
void leavesFrontToBack(const TileTree& tree, int tile, const Vec3d& eye, std::vector<int>& out) {
  if (tree.tiles[tile].children.empty()) out.push_back(tile);
  for (const int child : tree.childrenFrontToBack(tile, eye)) leavesFrontToBack(tree, child, eye, out);
}

TEST(TileTree, OrdersTilesAsEveryRayFromTheEyeCrossesThem) {
  const TileTree quads = testTree(8, 8);
  TileTree flat = testTree(8, 8);  // the same leaves, all children of one root
  {
    TileTree tree;
    tree.columns = tree.rows = 8;
    tree.tiles.push_back(flat.tiles[0]);
    tree.tiles[0].children.clear();
    for (const TileNode& node : flat.tiles) {
      if (!node.children.empty()) continue;
      tree.tiles[0].children.push_back(static_cast<int>(tree.tiles.size()));
      tree.tiles.push_back(node);
      tree.tiles.back().parent = 0;
    }
    flat = tree;
  }
  const RandomStream random(1, 1);
  uint64_t crossings = 0;
  for (uint64_t i = 0; i < 2000; ++i) {
    const auto value = [&](uint64_t k) { return 2 * random.uniformDouble(8 * i + k) - 1; };
    const Vec3d eye = 12 * Vec3d(value(0), value(1), 0.2 * value(2)), target(8 * value(3), 8 * value(4), value(5));
    const SceneRay ray{eye, (target - eye).normalized()};
    for (const TileTree* tree : {&quads, static_cast<const TileTree*>(&flat)}) {
      std::vector<int> order;
      leavesFrontToBack(*tree, 0, ray.origin, order);
      ASSERT_EQ(order.size(), 64u);
      double last = -1;
      for (const int tile : order) {
        const RayRange range = clipToBox(ray, tree->tiles[tile].low, tree->tiles[tile].high, {0, 1e6});
        if (range.far - range.near < 1e-9) continue;
        EXPECT_GE(range.near, last - 1e-9);
        last = range.near;
        ++crossings;
      }
    }
  }
  EXPECT_GT(crossings, 5000u);
}

TEST(TileTree, OrdersColumnsOfDifferentWidthsWhateverTheirBoxes) {
  TileTree tree;
  tree.columns = 10;
  tree.tiles.resize(4);
  tree.tiles[0].children = {1, 2, 3};
  tree.tiles[0].cells = {0, 0, 10, 1};
  const int first[] = {6, 0, 5}, end[] = {10, 5, 6};
  for (int i = 0; i < 3; ++i) {
    tree.tiles[i + 1].parent = 0;
    tree.tiles[i + 1].cells = {first[i], 0, end[i], 1};
  }
  tree.check();
  EXPECT_EQ(tree.childrenFrontToBack(0, Vec3d(-50, 0, 0)), (std::vector<int>{2, 3, 1}));
  EXPECT_EQ(tree.childrenFrontToBack(0, Vec3d(50, 0, 0)), (std::vector<int>{1, 3, 2}));
  EXPECT_EQ(tree.childrenFrontToBack(0, Vec3d(1, 0, 0)), (std::vector<int>{3, 1, 2}));  // the eye is in cell 5
}

TEST(TileTree, HasTheTopmostContentsForItsCoarsest) {
  TileTree tree = testTree(4, 4);
  EXPECT_EQ(tree.coarsest(), (std::vector<int>{0}));
  tree.tiles[0].hasContent = false;
  EXPECT_EQ(tree.coarsest(), tree.tiles[0].children);
  tree.tiles[0].hasContent = true;
  tree.tiles[tree.tiles[0].children[1]].hasContent = false;
  EXPECT_EQ(tree.coarsest(), (std::vector<int>{0}));
}

TEST(TileTree, LosesNothingButItsBackgroundBlocks) {
  const TileTree without = testTree(2, 2);
  TileTree tree = without;
  tree.backgroundBlock = static_cast<int>(tree.tiles.size());
  tree.tiles.resize(tree.tiles.size() + 2);
  for (TileNode* node : {&tree.tiles.end()[-2], &tree.tiles.end()[-1]}) node->isBackgroundBlock = true;
  tree.tiles.end()[-2].children = {tree.backgroundBlock + 1};
  tree.tiles.end()[-1].parent = tree.backgroundBlock;
  tree.check();
  for (int i = 0; i < 2; ++i) {
    tree.removeBackgroundBlocks();
    tree.check();
    EXPECT_EQ(tree.backgroundBlock, -1);
    EXPECT_EQ(tree.tiles.size(), without.tiles.size());
  }
}

}  // namespace
}  // namespace tessera
