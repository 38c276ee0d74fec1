#include "render/tile_selection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/random.h"
#include "render/testing/test_tree.h"

namespace tessera {
namespace {

Camera smallCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.parameters = {500, 500, 320, 240};
  return camera;
}

// Returns the pose of a camera at `eye` that looks at `target`.
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

// A budget for everything, with nothing in memory.
const TileMemory kAmpleMemory = {
    .budget = UINT64_MAX, .holds = [](int) { return false; }, .bytes = [](int) { return uint64_t{1}; }};

// Adds a coarse and a fine background block to a tree. Returns their indices.
std::pair<int, int> addBackgroundBlocks(TileTree& tree) {
  const int coarse = static_cast<int>(tree.tiles.size());
  TileNode node;
  node.isBackgroundBlock = true;
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
  tree.backgroundBlock = coarse;
  return {coarse, coarse + 1};
}

TEST(TileSelection, DrawsTheCoarseBackgroundBlockUntilTheFineOneIsThere) {
  TileTree tree = testTree(2, 2);
  const auto [coarse, fine] = addBackgroundBlocks(tree);
  TileSelector selector(tree, {});
  // At the border of the box, the background block fills the image, and its texels appear large.
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(1.9, 0, 0), Vec3d(10, 0, 0)), {});
  EXPECT_EQ(selector.cut(view, [fine = fine](int tile) { return tile != fine; }).backgroundBlock, coarse);
  EXPECT_EQ(selector.choose(view, kAmpleMemory).requested.at(0), fine);
  EXPECT_EQ(selector.cut(view, kAll).backgroundBlock, fine);
}

TEST(TileSelection, MeasuresTheVisibleShareOfTheBackgroundBlock) {
  TileFrame frame;
  frame.low = Vec3d(-8, -8, -0.5);
  frame.high = Vec3d(8, 8, 0.5);
  const auto share = [&](const Vec3d& eye, const Vec3d& target) {
    const TileView view = tileView(smallCamera(), lookingAt(eye, target), frame);
    return view.backgroundBlockPixels / view.pixels;
  };
  EXPECT_EQ(share(Vec3d(0, 0, 0.4), Vec3d(0, 0, -1)), 0);         // only ground
  EXPECT_EQ(share(Vec3d(0, 0, 0), Vec3d(0, 0, 1)), 0);            // only sky
  EXPECT_EQ(share(Vec3d(9, 0, 0), Vec3d(20, 0, 0)), 1);           // away from the box
  EXPECT_GT(share(Vec3d(0, 0, 40), Vec3d(0, 0, 0)), 0.4);         // the box is in the middle of the image
  EXPECT_NEAR(share(Vec3d(0, 0, 0), Vec3d(1, 0, 0)), 0.17, 0.1);  // a band along the horizon
}

TEST(TileSelection, RequestsNoFinerBackgroundBlockThanIsVisible) {
  TileTree tree = testTree(64, 64);
  const auto [coarse, fine] = addBackgroundBlocks(tree);
  for (const auto& [x, pixels, expected] : {std::tuple(0.0, 20.0, coarse), std::tuple(63.5, 20.0, fine),
                                            std::tuple(0.0, 1.0, fine), std::tuple(500.0, 20.0, fine)}) {
    TileSelector selector(tree, {pixels, 1.2, 0});
    const TileView view = tileView(smallCamera(), lookingAt(Vec3d(x, 0, 0), Vec3d(1000, 0, 0)), {});
    EXPECT_EQ(selector.cut(view, kAll).backgroundBlock, expected) << x << ", " << pixels << " pixels";
  }
  TileSelector limited(tree, {0, 1.2, 1});
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(63, 0, 0), Vec3d(1000, 0, 0)), {});
  EXPECT_EQ(limited.cut(view, kAll).backgroundBlock, coarse);
}

TEST(TileSelection, IsAPartitionOfTheRootForAllCamerasAndWhateverIsLoaded) {
  for (const auto& [columns, rows] : {std::pair(8, 8), std::pair(5, 3), std::pair(1, 1)}) {
    TileTree tree = testTree(columns, rows);
    const RandomStream random(1, 1);
    for (size_t tile = 1; tile < tree.tiles.size();
         ++tile) {  // some tiles stand for nothing, or for what is below them
      tree.tiles[tile].hasContent = random.uniform(tile) < 0.85f;
    }
    TileSelector selector(tree, {});
    std::set<size_t> sizes;
    for (uint64_t i = 0; i < 600; ++i) {
      const auto loaded = [&](int tile) { return tile == 0 || i % 3 == 0 || random.uniform(1000 * i + tile) < 0.7; };
      const TileCut cut = selector.cut(tileView(smallCamera(), randomPose(random, i), {}), loaded);
      ASSERT_TRUE(isPartition(tree, cut.tiles)) << i;
      for (const SelectedTile& selected : cut.tiles) {
        if (!selected.visible) continue;
        EXPECT_TRUE(loaded(selected.content));
        EXPECT_TRUE(tree.tiles[selected.content].hasContent);
        int above = selected.tile;
        while (above != selected.content && above >= 0) above = tree.tiles[above].parent;
        EXPECT_EQ(above, selected.content);
      }
      sizes.insert(cut.tiles.size());
    }
    if (columns == 8) {
      EXPECT_GT(sizes.size(), 5u);
    }
  }
}

TEST(TileSelection, MeetsTheScreenSpaceErrorWhereEverythingIsLoaded) {
  const TileTree tree = testTree(8, 8);
  const RandomStream random(2, 1);
  std::set<int> levels;
  for (uint64_t i = 0; i < 200; ++i) {
    TileSelector selector(tree, {});
    const TileView view = tileView(smallCamera(), randomPose(random, i), {});
    const TileCut cut = selector.cut(view, kAll);
    for (const SelectedTile& selected : cut.tiles) {
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

TEST(TileSelection, RequestsAllThatTheCutNeedsWithinTheBudget) {
  const TileTree tree = testTree(8, 8);
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(-7, -7, 1.5), Vec3d(0, 0, 0)), {});
  TileSelector selector(tree, {});
  const TileChoice choice = selector.choose(view, kAmpleMemory);
  EXPECT_EQ(choice.refused, 0);
  std::set<int> requested(choice.requested.begin(), choice.requested.end());
  EXPECT_EQ(requested.size(), choice.requested.size());
  EXPECT_LT(requested.size(), tree.tiles.size() - 1);  // tiles out of view are not requested
  requested.insert(0);
  const TileCut all = selector.cut(view, kAll),
                now = selector.cut(view, [&](int tile) { return requested.contains(tile); });
  ASSERT_EQ(now.tiles.size(), all.tiles.size());
  for (size_t i = 0; i < now.tiles.size(); ++i) {
    EXPECT_EQ(now.tiles[i].tile, all.tiles[i].tile);
    EXPECT_EQ(now.tiles[i].content, all.tiles[i].content);
  }
}

TEST(TileSelection, RequestsTheMostUrgentTilesThatFitWithTheirAncestors) {
  TileTree tree = testTree(8, 8);
  addBackgroundBlocks(tree);
  const RandomStream random(4, 1);
  int refused = 0;
  for (uint64_t i = 0; i < 200; ++i) {
    TileMemory memory = kAmpleMemory;
    memory.bytes = [&](int tile) { return 50 + random.below(static_cast<uint64_t>(tile), 100); };
    memory.budget = 300 + random.below(1000 + i, 3000);
    uint64_t bytes = memory.bytes(0) + memory.bytes(tree.backgroundBlock);
    TileSelector selector(tree, {});
    const TileView view = tileView(smallCamera(), randomPose(random, i), {});
    const TileChoice choice = selector.choose(view, memory);
    std::set<int> before = {0, tree.backgroundBlock};
    for (const int tile : choice.requested) {
      EXPECT_TRUE(before.contains(tree.tiles[tile].parent));
      EXPECT_TRUE(before.insert(tile).second);
      bytes += memory.bytes(tile);
    }
    EXPECT_LE(bytes, memory.budget);
    refused += choice.refused;
    memory.budget = UINT64_MAX;
    const TileChoice all = TileSelector(tree, {}).choose(view, memory);
    EXPECT_EQ(all.refused, 0);
    EXPECT_EQ(choice.refused == 0, all.requested == choice.requested);
  }
  EXPECT_GT(refused, 100);
}

TEST(TileSelection, PrefersResidentTilesToSlightlyMoreUrgentOnes) {
  const TileTree tree = testTree(2, 2);
  TileSelector selector(tree, {.maximumScreenSpaceError = 0});
  const auto choose = [&](double x, int residentTile) {
    const TileMemory memory{2, [residentTile](int tile) { return tile == residentTile; }, kAmpleMemory.bytes};
    const TileView view = tileView(smallCamera(), lookingAt(Vec3d(x, 0.01, 4), Vec3d(x, 0, 0)), {});
    const TileChoice choice = selector.choose(view, memory);
    return choice.requested.at(0);
  };
  const int left = choose(-0.1, -1), right = choose(0.1, -1);
  EXPECT_NE(left, right);
  EXPECT_EQ(choose(0.1, left), left);
  EXPECT_EQ(choose(2.5, left), right);
}

TEST(TileSelection, DrawsResidentTilesAndAncestorsInTheCellsOfMissingOnes) {
  const TileTree tree = testTree(2, 2);
  TileSelector selector(tree, {.maximumScreenSpaceError = 0});
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(0, 0, 8), Vec3d(0, 0, 0)), {});
  const int there = tree.tiles[0].children[2];
  const TileCut cut = selector.cut(view, [&](int tile) { return tile == 0 || tile == there; });
  EXPECT_TRUE(isPartition(tree, cut.tiles));
  EXPECT_EQ(cut.tiles.size(), 4u);
  for (const SelectedTile& selected : cut.tiles) EXPECT_EQ(selected.content, selected.tile == there ? there : 0);
  const TileCut without = selector.cut(view, [](int tile) { return tile == 0; });
  ASSERT_EQ(without.tiles.size(), 1u);
  EXPECT_EQ(without.tiles[0].content, 0);
}

TEST(TileSelection, DoesNotFlickerWhereTheErrorSwingsByLessThanTheHysteresis) {
  const TileTree tree = testTree(2, 2);
  TileSelector selector(tree, {});
  const auto replacedAt = [&](double error) {  // the root's error in pixels
    const double distance = tree.tiles[0].geometricError * 500 / error;
    const Pose pose = lookingAt(Vec3d(0, 0, 1 + distance), Vec3d(0, 0, 0));
    return selector.cut(tileView(smallCamera(), pose, {}), kAll).tiles.size() > 1;
  };
  EXPECT_FALSE(replacedAt(1.4));
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(replacedAt(1.49 - 0.2 * (i % 2)));
  EXPECT_TRUE(replacedAt(1.51));
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(replacedAt(1.26 + 0.4 * (i % 2)));
  EXPECT_FALSE(replacedAt(1.24));
  EXPECT_FALSE(replacedAt(1.49));
}

TEST(TileSelection, SeesEveryTileThatAnyPixelLooksAt) {
  const TileTree tree = testTree(8, 8);
  const RandomStream random(3, 1);
  Camera distorted = smallCamera();
  distorted.lens = LensModel::openCv;
  distorted.parameters = {400, 410, 300, 250, -0.1, 0.02, 0.001, 0.002};
  Camera fisheye = smallCamera();
  fisheye.lens = LensModel::openCvFisheye;
  fisheye.parameters = {250, 250, 320, 240, 0.01, 0, 0, 0};
  TileFrame frame;  // rotated, translated, with units of metres
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
  const TileTree tree = testTree(4, 4);
  TileSelector selector(tree, {.maximumScreenSpaceError = 0, .finestLevel = 1});
  const TileCut cut = selector.cut(tileView(smallCamera(), lookingAt(Vec3d(0, 0, 30), Vec3d(0, 0, 0)), {}), kAll);
  EXPECT_EQ(cut.tiles.size(), 4u);
  for (const SelectedTile& selected : cut.tiles) EXPECT_EQ(tree.tiles[selected.tile].level, 1);
}

TEST(TileSelection, RequestsTheChildrenOfATileWithoutContent) {
  TileTree tree = testTree(4, 4);
  const int middle = tree.tiles[0].children[0];
  tree.tiles[middle].hasContent = false;
  const int empty = tree.tiles[middle].children[3];
  tree.tiles[empty].hasContent = false;
  TileSelector selector(tree, {});
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(0, 0, 4.5), Vec3d(0, 0, 0)), {});
  const TileChoice choice = selector.choose(view, kAmpleMemory);
  const std::set<int> requested(choice.requested.begin(), choice.requested.end());
  EXPECT_FALSE(requested.contains(middle));
  EXPECT_FALSE(requested.contains(empty));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(requested.contains(tree.tiles[middle].children[i]));
  // Until they are in memory, the root is drawn in their cells.
  const TileCut cut = selector.cut(view, [&](int tile) { return tree.tiles[tile].parent <= 0; });
  EXPECT_TRUE(isPartition(tree, cut.tiles));
  EXPECT_EQ(std::count_if(cut.tiles.begin(), cut.tiles.end(), [](const SelectedTile& s) { return s.content == 0; }), 1);
}

TEST(TileSelection, DrawsFinerTilesThanNeededRatherThanNone) {
  TileTree tree = testTree(4, 4);
  TileSelector selector(tree, {});
  const int middle = tree.tiles[0].children[0];
  const TileView near = tileView(smallCamera(), lookingAt(Vec3d(-2, -2, 6), Vec3d(-2, -2, 0)), {});
  ASSERT_LE(near.errorInPixels(tree.tiles[middle]), 1.5);
  ASSERT_GT(near.errorInPixels(tree.tiles[0]), 1.5);
  const TileCut selection = selector.cut(near, [&](int tile) { return tile != middle; });
  EXPECT_TRUE(isPartition(tree, selection.tiles));
  std::set<int> cut;
  for (const SelectedTile& selected : selection.tiles) cut.insert(selected.content);
  for (const int child : tree.tiles[middle].children) EXPECT_TRUE(cut.contains(child));
  const TileChoice choice = selector.choose(near, kAmpleMemory);
  EXPECT_NE(std::find(choice.requested.begin(), choice.requested.end(), middle), choice.requested.end());
}

// All four tiles below the root need one resource, which is as large as ten of them.
TEST(TileSelection, ChargesASharedResourceOnceAtTheFirstTileThatNeedsIt) {
  const TileTree tree = testTree(2, 2);
  const TileView view = tileView(smallCamera(), lookingAt(Vec3d(0, -4, 3), Vec3d::Zero()), {});
  const auto chosen = [&](uint64_t budget, bool rootNeedsIt) {
    TileMemory memory = kAmpleMemory;
    memory.budget = budget;
    memory.tileResources = [=](int tile) { return tile > 0 || rootNeedsIt ? std::vector<int>{3} : std::vector<int>(); };
    memory.bytesOfResource = [](int resource) { return uint64_t{resource == 3 ? 10u : 1000u}; };
    TileSelector selector(tree, {0, 1.2, 0});
    const TileChoice choice = selector.choose(view, memory);
    EXPECT_EQ(choice.requested.size() + static_cast<size_t>(choice.refused), 4u);
    return choice.requested.size();
  };
  EXPECT_EQ(chosen(1 + 4, false), 0u);  // a refused tile adds no resource
  EXPECT_EQ(chosen(1 + 10, false), 0u);
  EXPECT_EQ(chosen(1 + 10 + 1, false), 1u);
  EXPECT_EQ(chosen(1 + 10 + 4, false), 4u);
  EXPECT_EQ(chosen(1 + 10, true), 0u);  // the resource was charged to the root
  EXPECT_EQ(chosen(1 + 10 + 2, true), 2u);
}

}  // namespace
}  // namespace tessera
