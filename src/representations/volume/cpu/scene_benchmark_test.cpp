#include "render/cpu/scene_benchmark.h"

#include <gtest/gtest.h>

#include <set>

#include "base/error.h"
#include "representations/volume/testing/test_scene.h"
#include "representations/volume/testing/volume_renderer.h"

namespace tessera {
namespace {

TileScene scene() {
  TileScene scene;
  scene.frame = place().frame;
  scene.frame.rotation = Eigen::AngleAxisd(0.4, Vec3d::UnitZ()).toRotationMatrix();
  scene.frame.scale = 25;
  scene.frame.translation = {10, -20, 5};
  scene.tree = place().tree;
  scene.source = place().source();
  scene.background = {0.5f, 0.6f, 0.7f};
  return scene;
}

TEST(SceneBenchmark, CountsTheSameSamplesInFewerSteps) {
  const TileScene tileScene = scene();
  BenchmarkView view;
  view.camera.width = 24;
  view.camera.height = 16;
  view.camera.parameters = {20, 20, 12, 8};
  std::vector<BenchmarkView> views(2, view);
  for (size_t i = 0; i < views.size(); ++i)
    views[i].worldFromCamera = flightPose(tileScene.frame, tileScene.tree, 0.1 + 0.5 * i);
  const SkippingBenchmark result = benchmarkSkipping(tileScene, makeVolumeDrawer, views, 1);
  EXPECT_EQ(result.rays, 2u * 24 * 16);
  EXPECT_GT(result.skipping.counts.samples, 1000u);
  EXPECT_EQ(result.skipping.counts.samples, result.whole.counts.samples);
  EXPECT_LT(result.skipping.counts.steps, result.whole.counts.steps);
  EXPECT_GE(result.skipping.counts.steps, result.skipping.counts.samples);
  EXPECT_EQ(result.largestDifference, 0);
  EXPECT_GT(result.skipping.seconds, 0);
  EXPECT_GT(result.whole.seconds, 0);
  EXPECT_EQ(result.device.find("cpu "), 0u);
}

CacheBenchmarkOptions smallPictures() {
  CacheBenchmarkOptions options;
  options.steps = 120;
  options.width = 16;
  options.height = 12;
  options.maximumScreenSpaceError = 16;  // texels of the test scene are eight times as coarse as real ones
  options.threads = 1;
  return options;
}

TEST(SceneBenchmark, FliesThroughAQuarterOfTheFinestLevel) {
  const CacheBenchmark result = benchmarkCache(scene(), makeVolumeDrawer, smallPictures());
  EXPECT_EQ(result.finestBytes, place().finestBytes);
  EXPECT_EQ(result.allBytes, place().allBytes);
  EXPECT_EQ(result.tight.budgetBytes, place().finestBytes / 4);
  EXPECT_EQ(result.whole.budgetBytes, place().allBytes);
  for (const CacheBenchmark::Run& run : {result.tight, result.whole}) {
    EXPECT_EQ(run.stepsOverBudget, 0);
    EXPECT_EQ(run.stepsWithoutCoarsest, 0);
    EXPECT_EQ(run.stepsWithoutPartition, 0);
    EXPECT_EQ(run.stepsUnlikeUnbounded, 0);
    EXPECT_LE(run.maxBytes, run.budgetBytes);
    EXPECT_GT(run.maxBytes, place().coarsestBytes);
  }
  EXPECT_GT(result.tight.evictions, 0u);
  EXPECT_GT(result.tight.refused, 0u);
  EXPECT_GT(result.tight.meanSquaredError, 0);
  EXPECT_GT(result.tight.tilesOfLevel0, 0.2);
  EXPECT_LT(result.tight.tilesOfLevel0, result.whole.tilesOfLevel0);
  EXPECT_EQ(result.whole.meanSquaredError, 0);
  EXPECT_GT(result.tight.stepsInFull, 0);
  EXPECT_LT(result.tight.stepsInFull, result.steps);
  EXPECT_EQ(result.whole.evictions, 0u);
  EXPECT_EQ(result.whole.stepsInFull, result.steps);
}

TEST(SceneBenchmark, RefusesABudgetBelowTheCoarsestLevel) {
  CacheBenchmarkOptions options = smallPictures();
  options.finestShare = 0.9 * static_cast<double>(place().coarsestBytes) / static_cast<double>(place().finestBytes);
  EXPECT_THROW(benchmarkCache(scene(), makeVolumeDrawer, options), Error);
}

TEST(SceneBenchmark, FliesOverEveryCellLowAndHigh) {
  const TileScene tileScene = scene();
  std::set<std::pair<int, int>> low, high;
  double top = 0;
  for (int step = 0; step < 600; ++step) {
    const Pose pose = flightPose(tileScene.frame, tileScene.tree, step / 600.0);
    EXPECT_LT((pose.rotation.transpose() * pose.rotation - Mat3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-12);
    const Vec3d eye = tileScene.frame.inScene(pose.translation),
                forward = tileScene.frame.rotation.transpose() * pose.rotation.col(2);
    EXPECT_LT(forward.z(), 0);
    EXPECT_GT(eye.z(), tileScene.frame.high.z());
    const std::pair<int, int> cell(std::floor(0.5 * (eye.x() + 4)), std::floor(0.5 * (eye.y() + 4)));
    (step < 300 ? low : high).insert(cell);
    if (step < 300) {
      EXPECT_LT(eye.z(), tileScene.frame.high.z() + 0.3);
    }
    top = std::max(top, eye.z());
  }
  EXPECT_GE(low.size(), 16u);
  EXPECT_GE(high.size(), 16u);
  EXPECT_GT(top, 8);
}

TEST(SceneBenchmark, DistinguishesPartitionsFromOtherCuts) {
  const TileTree tree = testTree(4, 4);
  const auto selectTilesAtLevel = [&](int level) {
    std::vector<SelectedTile> cut;
    for (size_t i = 0; i < tree.tiles.size(); ++i) {
      if (tree.tiles[i].level == level) cut.push_back({static_cast<int>(i), static_cast<int>(i), true});
    }
    return cut;
  };
  for (const int level : {0, 1, 2}) EXPECT_TRUE(isPartition(tree, selectTilesAtLevel(level))) << level;
  std::vector<SelectedTile> cut = selectTilesAtLevel(0);
  cut.pop_back();
  EXPECT_FALSE(isPartition(tree, cut));
  cut = selectTilesAtLevel(1);
  cut.push_back(selectTilesAtLevel(0).front());
  EXPECT_FALSE(isPartition(tree, cut));
}

}  // namespace
}  // namespace tessera
