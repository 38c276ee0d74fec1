#include "representations/volume/testing/volume_renderer.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "base/error.h"
#include "render/cpu/scene_renderer.h"
#include "representations/volume/testing/flat_tile_tree.h"
#include "representations/volume/testing/test_scene.h"

namespace tessera {
namespace {

SceneRendererSettings settingsWith(uint64_t budget) {
  SceneRendererSettings settings;
  settings.budgetBytes = budget;
  settings.threads = 1;
  return settings;
}

TEST(VolumeRenderer, NeverExceedsAQuarterOfTheFinestLevelAndNeverLacksTheCoarsest) {
  const uint64_t budget = place().finestBytes / 4;
  ASSERT_LT(place().coarsestBytes, budget);
  SceneRendererSettings settings = settingsWith(budget);
  settings.selection.maximumScreenSpaceError = 0.2;  // small, because the image is small
  VolumeRenderer renderer(place().frame, place().tree, place().source(), settings);
  std::set<int> drawn;
  for (int step = 0; step < 600; ++step) {
    renderer.render(flightCamera().scaledTo(16, 12), flightPose(step), nullptr);
    for (const SelectedTile& selected : renderer.cut().tiles) {
      if (selected.visible) drawn.insert(selected.content);
    }
    ASSERT_FALSE(renderer.cut().tiles.empty());
    ASSERT_LE(renderer.cacheStatistics().maxBytes, budget);
  }
  EXPECT_GT(renderer.cacheStatistics().evictions, 0u);
  EXPECT_GT(drawn.size(), 6u);
}

TEST(VolumeRenderer, RendersAsWithoutABudgetWhereTheRequestedTilesFit) {
  // The tiles that an error of 1.5 pixels requests do not fit in the budget; those of 16 pixels do.
  for (const double pixels : {16.0, 1.5}) {
    SceneRendererSettings settings = settingsWith(place().allBytes), tight = settingsWith(place().finestBytes / 3);
    settings.selection.maximumScreenSpaceError = tight.selection.maximumScreenSpaceError = pixels;
    VolumeRenderer unbounded(place().frame, place().tree, place().source(), settings);
    VolumeRenderer bounded(place().frame, place().tree, place().source(), tight);
    int same = 0, frames = 0;
    for (int step = 0; step < 600; step += 20, ++frames) {
      const RenderedView a = unbounded.render(flightCamera(), flightPose(step), nullptr);
      const RenderedView b = bounded.render(flightCamera(), flightPose(step), nullptr);
      EXPECT_EQ(unbounded.choice().refused, 0);
      if (bounded.choice().refused > 0) continue;
      ++same;
      EXPECT_EQ(a.colour.pixels, b.colour.pixels) << step;
      EXPECT_EQ(a.depth.pixels, b.depth.pixels) << step;
    }
    if (pixels > 10) {
      EXPECT_GT(same, frames / 2);
    } else {
      EXPECT_LT(same, frames / 2);
    }
    EXPECT_LE(bounded.cacheStatistics().maxBytes, tight.budgetBytes);
    EXPECT_EQ(unbounded.cacheStatistics().evictions, 0u);
  }
}

// Each pixel whose ray meets a single tile of the cut shows that tile's content as if it were alone.
TEST(VolumeRenderer, DrawsAnAncestorOnlyInTheCellsOfAMissingTile) {
  SceneRendererSettings settings = settingsWith(place().finestBytes / 3);
  settings.selection.maximumScreenSpaceError = 0;
  VolumeRenderer renderer(place().frame, place().tree, place().source(), settings);
  int pixels = 0, instead = 0;
  for (int step = 0; step < 600; step += 50) {
    const RenderedView view = renderer.render(flightCamera(), flightPose(step), nullptr);
    EXPECT_GT(renderer.choice().refused, 0);
    std::map<int, RenderedView> alone;
    for (const SelectedTile& one : renderer.cut().tiles) {
      if (!one.visible || alone.contains(one.content)) continue;
      ThreadPool pool(1);
      const SceneDrawing<VolumeContent> drawing{
          place().frame, {&place().contents[one.content]}, &place().contents.back(), {}};
      alone.emplace(one.content, drawScene(drawing, flightCamera(), flightPose(step), nullptr, pool));
    }
    for (int y = 0; y < flightCamera().height; ++y) {
      for (int x = 0; x < flightCamera().width; ++x) {
        const Vec3d d = flightPose(step).rotation * *flightCamera().directionInCamera(Vec2d(x + 0.5, y + 0.5));
        std::vector<SelectedTile> met;
        for (const SelectedTile& one : renderer.cut().tiles) {
          const TileNode& node = place().tree.tiles[one.tile];
          const SceneRay ray{flightPose(step).translation, d.normalized()};
          if (one.visible && !clipToBox(ray, node.low, node.high, {1e-9, 1e6}).empty()) met.push_back(one);
        }
        if (met.size() != 1) continue;
        const RenderedView& expected = alone.at(met[0].content);
        ++pixels;
        instead += met[0].content != met[0].tile;
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(view.colour.at(x, y)[c], expected.colour.at(x, y)[c], 1e-5) << step;
      }
    }
  }
  EXPECT_GT(instead, 500);
  EXPECT_GT(pixels - instead, 500);
}

TEST(VolumeRenderer, DrawsTheFinestLevelWhereNoErrorIsAllowed) {
  SceneRendererSettings settings = settingsWith(place().allBytes);
  settings.selection.maximumScreenSpaceError = 0;
  VolumeRenderer renderer(place().frame, place().tree, place().source(), settings);
  const RenderedView view = renderer.render(flightCamera(), flightPose(0), nullptr);
  std::vector<VolumeContent> finest;
  for (size_t i = 0; i < place().tree.tiles.size(); ++i) {
    if (place().tree.tiles[i].level == 0 && static_cast<int>(i) != place().tree.backgroundBlock) {
      finest.push_back(place().contents[i]);
    }
  }
  ASSERT_EQ(finest.size(), 16u);
  const VolumeContent& backgroundBlock = place().contents.back();
  const auto contentAt = [&](int tile) -> const VolumeContent& {
    return tile == 17 ? backgroundBlock : finest[tile - 1];
  };
  const TileSource<Content> source = sourceOfCopies(contentAt);
  VolumeRenderer flat(place().frame, flatTileTree(finest, true), source, settings);
  const RenderedView expected = flat.render(flightCamera(), flightPose(0), nullptr);
  EXPECT_EQ(view.colour.pixels, expected.colour.pixels);
  EXPECT_EQ(view.opacity.pixels, expected.opacity.pixels);
  double opacity = 0;
  for (const float value : view.opacity.pixels) opacity += value;
  EXPECT_GT(opacity / static_cast<double>(view.opacity.pixels.size()), 0.3);
}

TEST(VolumeRenderer, OrdersMixedLevelsAsEachRayMeetsThem) {
  SceneRendererSettings settings = settingsWith(place().allBytes);
  settings.selection.maximumScreenSpaceError = 1;
  VolumeRenderer renderer(place().frame, place().tree, place().source(), settings);
  bool mixed = false;
  for (int step = 0; step < 600; step += 7) {
    renderer.render(flightCamera().scaledTo(16, 12), flightPose(step), nullptr);
    std::set<int> levels;
    for (int pixel = 0; pixel < 20; ++pixel) {
      const Vec3d d = *flightCamera().directionInCamera(Vec2d(3.2 * pixel, 2.4 * pixel));
      double last = -1;
      for (const SelectedTile& selected : renderer.cut().tiles) {
        const TileNode& node = place().tree.tiles[selected.tile];
        levels.insert(node.level);
        const RayRange range =
            clipToBox({flightPose(step).translation, flightPose(step).rotation * d}, node.low, node.high, {0, 1e6});
        if (range.far - range.near < 1e-9) continue;
        EXPECT_GE(range.near, last - 1e-9);
        last = range.near;
      }
    }
    mixed |= levels.size() > 1;
  }
  EXPECT_TRUE(mixed);
}

TEST(VolumeRenderer, NamesItsDeviceAndRejectsBudgetsBelowTheCoarsestLevel) {
  VolumeRenderer renderer(place().frame, place().tree, place().source(), settingsWith(place().coarsestBytes));
  EXPECT_EQ(renderer.device().find("cpu "), 0u);
  EXPECT_NE(renderer.device().find("1 threads"), std::string::npos);
  EXPECT_THROW(VolumeRenderer(place().frame, place().tree, place().source(), settingsWith(place().coarsestBytes - 1)),
               Error);
}

TEST(VolumeRenderer, RendersTheSameEveryTime) {
  VolumeRenderer renderer(place().frame, place().tree, place().source(), settingsWith(place().allBytes));
  const RenderedView first = renderer.render(flightCamera(), flightPose(3), nullptr);
  renderer.render(flightCamera(), flightPose(4), nullptr);
  const RenderedView again = renderer.render(flightCamera(), flightPose(3), nullptr);
  EXPECT_EQ(first.colour.pixels, again.colour.pixels);
  EXPECT_EQ(first.depth.pixels, again.depth.pixels);
}

}  // namespace
}  // namespace tessera
