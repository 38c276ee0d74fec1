#include "render/tile_selection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/random.h"
#include "render/made_tree.h"

namespace tessera {
namespace {

Camera smallCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.parameters = {500, 500, 320, 240};
  return camera;
}

// At `eye`, looking at `target`.
Pose lookingAt(const Vec3d& eye, const Vec3d& target) {
  Pose pose;
  const Vec3d forward = (target - eye).normalized();
  const Vec3d right = forward.cross(std::abs(forward.z()) < 0.99 ? Vec3d::UnitZ() : Vec3d::UnitY()).normalized();
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.translation = eye;
  return pose;
}

Pose randomPose(const RandomStream& random, uint64_t i) {
  const auto value = [&](uint64_t k) { return 2 * random.uniformDouble(8 * i + k) - 1; };
  return lookingAt(Vec3d(9 * value(0), 9 * value(1), 0.2 + 6 * std::abs(value(2))),
                   Vec3d(6 * value(3), 6 * value(4), 0));
}

bool isPartition(const TileTree& tree, const std::vector<SelectedTile>& cut) {
  std::set<int> chosen;
  for (const SelectedTile& selected : cut) {
    if (!chosen.insert(selected.tile).second) return false;
  }
  for (size_t i = 0; i < tree.tiles.size(); ++i) {
    if (!tree.tiles[i].children.empty()) continue;
    int covers = 0;
    for (int tile = static_cast<int>(i); tile >= 0; tile = tree.tiles[tile].parent) covers += chosen.contains(tile);
    if (covers != 1) return false;
  }
  return true;
}

const auto kAll = [](int) { return true; };

// A tree with a coarse and a fine surround. Returns their numbers.
std::pair<int, int> addSurrounds(TileTree& tree) {
  const int coarse = static_cast<int>(tree.tiles.size());
  TileNode node;
  node.isSurround = true;
  node.low = Vec3d(-tree.columns, -tree.rows, -1);
  node.high = Vec3d(tree.columns, tree.rows, 1);
  node.level = 1;
  node.geometricError = 4.0 * tree.columns / 256;
  node.children = {coarse + 1};
  tree.tiles.push_back(node);
  node.level = 0;
  node.parent = coarse;
  node.children.clear();
  node.geometricError /= 2;
  tree.tiles.push_back(node);
  tree.surround = coarse;
  return {coarse, coarse + 1};
}

TEST(TileSelection, DrawsTheCoarseSurroundUntilTheFineOneIsThere) {
  TileTree tree = madeTree(2, 2);
  const auto [coarse, fine] = addSurrounds(tree);
  TileSelector selector(tree, {});
  // At the border of the box it fills the picture, and its texels are large.
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(1.9, 0, 0), Vec3d(10, 0, 0)), {});
  const Selection before = selector.select(view, [fine = fine](int tile) { return tile != fine; });
  EXPECT_EQ(before.surround, coarse);
  ASSERT_EQ(before.requests.size(), 1u);
  EXPECT_EQ(before.requests[0].tiles, std::vector<int>{fine});
  const Selection after = selector.select(view, kAll);
  EXPECT_EQ(after.surround, fine);
  EXPECT_TRUE(after.requests.empty());
}

TEST(TileSelection, AsksForNoFinerSurroundThanIsSeen) {
  TileTree tree = madeTree(64, 64);
  const auto [coarse, fine] = addSurrounds(tree);
  for (const auto& [x, pixels, expected] : {std::tuple(0.0, 20.0, coarse), std::tuple(63.5, 20.0, fine),
                                            std::tuple(0.0, 1.0, fine), std::tuple(500.0, 20.0, fine)}) {
    TileSelector selector(tree, {pixels, 1.2, 0});
    const TileView view = tileView(smallCamera(), lookingAt(Vec3d(x, 0, 0), Vec3d(1000, 0, 0)), {});
    EXPECT_EQ(selector.select(view, kAll).surround, expected) << x << ", " << pixels << " pixels";
  }
  TileSelector limited(tree, {0, 1.2, 1});
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(63, 0, 0), Vec3d(1000, 0, 0)), {});
  EXPECT_EQ(limited.select(view, kAll).surround, coarse);
}

TEST(TileSelection, IsAPartitionOfTheRootForAllCamerasAndWhateverIsLoaded) {
  for (const auto& [columns, rows] : {std::pair(8, 8), std::pair(5, 3), std::pair(1, 1)}) {
    TileTree tree = madeTree(columns, rows);
    const RandomStream random(1, 1);
    for (size_t tile = 1; tile < tree.tiles.size(); ++tile) {  // some stand for nothing, or for what is below
      tree.tiles[tile].hasContent = random.uniform(tile) < 0.85f;
    }
    TileSelector selector(tree, {});
    std::set<size_t> sizes;
    for (uint64_t i = 0; i < 600; ++i) {
      const auto loaded = [&](int tile) { return tile == 0 || i % 3 == 0 || random.uniform(1000 * i + tile) < 0.7; };
      const Selection selection = selector.select(tileView(smallCamera(), randomPose(random, i), {}), loaded);
      ASSERT_TRUE(isPartition(tree, selection.cut)) << i;
      for (const SelectedTile& selected : selection.cut) {
        if (selected.visible) {
          EXPECT_TRUE(loaded(selected.tile));
          EXPECT_TRUE(tree.tiles[selected.tile].hasContent);
        }
      }
      for (const TileRequest& request : selection.requests) {
        EXPECT_FALSE(request.tiles.empty());
        for (const int tile : request.tiles) {
          EXPECT_FALSE(loaded(tile));
          EXPECT_TRUE(tree.tiles[tile].hasContent);
        }
      }
      sizes.insert(selection.cut.size());
    }
    if (columns == 8) {
      EXPECT_GT(sizes.size(), 5u);
    }
  }
}

TEST(TileSelection, IsAsFineAsAskedForWhereAllIsLoaded) {
  const TileTree tree = madeTree(8, 8);
  const RandomStream random(2, 1);
  std::set<int> levels;
  for (uint64_t i = 0; i < 200; ++i) {
    TileSelector selector(tree, {});
    const TileView view = tileView(smallCamera(), randomPose(random, i), {});
    const Selection selection = selector.select(view, kAll);
    EXPECT_TRUE(selection.requests.empty());
    for (const SelectedTile& selected : selection.cut) {
      if (!selected.visible) continue;
      const TileNode& node = tree.tiles[selected.tile];
      levels.insert(node.level);
      if (node.level > 0) {
        EXPECT_LE(view.errorInPixels(node), 1.5);
      }
      if (node.parent >= 0) {
        EXPECT_GT(view.errorInPixels(tree.tiles[node.parent]), 1.5);
      }
    }
  }
  EXPECT_GE(levels.size(), 3u);
}

TEST(TileSelection, AsksForTheMostUrgentFirstAndThenForNothing) {
  const TileTree tree = madeTree(8, 8);
  TileSelector selector(tree, {});
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(-7, -7, 1.5), Vec3d(0, 0, 0)), {});
  std::set<int> loaded = {0};
  const auto isLoaded = [&](int tile) { return loaded.contains(tile); };
  int rounds = 0;
  for (;; ++rounds) {
    const Selection selection = selector.select(view, isLoaded);
    if (selection.requests.empty()) break;
    for (size_t i = 0; i + 1 < selection.requests.size(); ++i) {
      EXPECT_GE(selection.requests[i].priority, selection.requests[i + 1].priority);
    }
    loaded.insert(selection.requests[0].tiles.begin(), selection.requests[0].tiles.end());
    ASSERT_LT(rounds, 100);
  }
  EXPECT_GE(rounds, 3);
  TileSelector fresh(tree, {});
  const Selection all = fresh.select(view, kAll), now = selector.select(view, isLoaded);
  ASSERT_EQ(now.cut.size(), all.cut.size());
  for (size_t i = 0; i < now.cut.size(); ++i) EXPECT_EQ(now.cut[i].tile, all.cut[i].tile);
  EXPECT_LT(loaded.size(), tree.tiles.size());  // what cannot be seen was not asked for
}

TEST(TileSelection, DoesNotFlickerWhereTheErrorSwingsByLessThanTheHysteresis) {
  const TileTree tree = madeTree(2, 2);
  TileSelector selector(tree, {});
  const auto replacedAt = [&](double error) {  // of the root, in pixels
    const double distance = tree.tiles[0].geometricError * 500 / error;
    const Pose pose = lookingAt(Vec3d(0, 0, 1 + distance), Vec3d(0, 0, 0));
    return selector.select(tileView(smallCamera(), pose, {}), kAll).cut.size() > 1;
  };
  EXPECT_FALSE(replacedAt(1.4));
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(replacedAt(1.49 - 0.2 * (i % 2)));
  EXPECT_TRUE(replacedAt(1.51));
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(replacedAt(1.26 + 0.4 * (i % 2)));
  EXPECT_FALSE(replacedAt(1.24));
  EXPECT_FALSE(replacedAt(1.49));
}

TEST(TileSelection, SeesEveryTileThatAnyPixelLooksAt) {
  const TileTree tree = madeTree(8, 8);
  const RandomStream random(3, 1);
  Camera distorted = smallCamera();
  distorted.lens = LensModel::openCv;
  distorted.parameters = {400, 410, 300, 250, -0.1, 0.02, 0.001, 0.002};
  Camera fisheye = smallCamera();
  fisheye.lens = LensModel::openCvFisheye;
  fisheye.parameters = {250, 250, 320, 240, 0.01, 0, 0, 0};
  VolumeFrame frame;  // turned, moved, in metres
  frame.rotation = Eigen::AngleAxisd(0.7, Vec3d::UnitZ()).toRotationMatrix();
  frame.scale = 30;
  frame.translation = Vec3d(100, -50, 20);
  int culled = 0;
  for (uint64_t i = 0; i < 60; ++i) {
    const Camera& camera = i % 3 == 0 ? fisheye : i % 3 == 1 ? distorted : smallCamera();
    const Pose inScene = randomPose(random, i);
    const Pose pose{frame.rotation * inScene.rotation,
                    frame.scale * (frame.rotation * inScene.translation) + frame.translation};
    const TileView view = tileView(camera, pose, frame);
    for (const TileNode& node : tree.tiles) culled += !view.sees(node);
    for (int y = 0; y < camera.height; y += 16) {
      for (int x = 0; x < camera.width; x += 16) {
        const std::optional<Vec3d> d = camera.directionInCamera(Vec2d(x + 0.5, y + 0.5));
        if (!d) continue;
        const SceneRay ray{view.eye, view.cameraFromScene.transpose() * *d};
        for (const TileNode& node : tree.tiles) {
          if (!clipToBox(ray, node.low, node.high, {0, 1e6}).empty()) {
            ASSERT_TRUE(view.sees(node)) << i;
          }
        }
      }
    }
  }
  EXPECT_GT(culled, 500);
}

TEST(TileSelection, StopsAtTheFinestLevelThatIsAllowed) {
  const TileTree tree = madeTree(4, 4);
  TileSelector selector(tree, {.mostPixels = 0, .finestLevel = 1});
  const Selection selection =
      selector.select(tileView(smallCamera(), lookingAt(Vec3d(0, 0, 30), Vec3d(0, 0, 0)), {}), kAll);
  EXPECT_EQ(selection.cut.size(), 4u);
  for (const SelectedTile& selected : selection.cut) EXPECT_EQ(tree.tiles[selected.tile].level, 1);
}

TEST(TileSelection, AsksForWhatIsBelowATileWithoutContent) {
  TileTree tree = madeTree(4, 4);
  const int middle = tree.tiles[0].children[0];
  tree.tiles[middle].hasContent = false;
  const int empty = tree.tiles[middle].children[3];
  tree.tiles[empty].hasContent = false;
  TileSelector selector(tree, {});
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(0, 0, 4.5), Vec3d(0, 0, 0)), {});
  const Selection selection = selector.select(view, [&](int tile) { return tree.tiles[tile].parent <= 0; });
  EXPECT_EQ(selection.cut.size(), 1u);
  ASSERT_FALSE(selection.requests.empty());
  const std::vector<int>& tiles = selection.requests[0].tiles;
  EXPECT_EQ(std::set<int>(tiles.begin(), tiles.end()),
            std::set<int>(tree.tiles[middle].children.begin(), tree.tiles[middle].children.end() - 1));
  EXPECT_EQ(selection.requests[0].beside.size(), 3u);
}

TEST(TileSelection, DrawsFinerTilesThanAskedForRatherThanNone) {
  TileTree tree = madeTree(4, 4);
  TileSelector selector(tree, {});
  const int middle = tree.tiles[0].children[0];
  const TileView near = tileView(smallCamera(), lookingAt(Vec3d(-2, -2, 6), Vec3d(-2, -2, 0)), {});
  ASSERT_LE(near.errorInPixels(tree.tiles[middle]), 1.5);
  ASSERT_GT(near.errorInPixels(tree.tiles[0]), 1.5);
  const Selection selection = selector.select(near, [&](int tile) { return tile != middle; });
  EXPECT_TRUE(isPartition(tree, selection.cut));
  std::set<int> cut;
  for (const SelectedTile& selected : selection.cut) cut.insert(selected.tile);
  for (const int child : tree.tiles[middle].children) EXPECT_TRUE(cut.contains(child));
  ASSERT_EQ(selection.requests.size(), 1u);
  EXPECT_EQ(selection.requests[0].tiles, (std::vector<int>{middle}));
}

}  // namespace
}  // namespace tessera
