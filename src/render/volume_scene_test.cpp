#include "render/volume_scene.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"
#include "render/cpu/volume_renderer.h"

namespace tessera {
namespace {

const fs::path kScene = TESSERA_GOLDEN_VOLUME;

Camera camera() {
  Camera camera;
  camera.width = 96;
  camera.height = 72;
  camera.parameters = {80, 80, 48, 36};
  return camera;
}

// In the world, from a place in the scene.
Pose lookingAt(const VolumeFrame& frame, const Vec3d& eye, const Vec3d& target) {
  Pose pose;
  const Vec3d forward = (target - eye).normalized(), right = forward.cross(Vec3d::UnitZ()).normalized();
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.rotation = frame.rotation * pose.rotation;
  pose.translation = frame.scale * (frame.rotation * eye) + frame.translation;
  return pose;
}

TEST(VolumeScene, KnowsWhatContentsTakeInMemoryBeforeTheyAreLoaded) {
  const VolumeScene scene = openVolumeScene(kScene);
  scene.tree.check();
  int contents = 0;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    if (!scene.tree.tiles[i].hasContent) continue;
    const int tile = static_cast<int>(i);
    EXPECT_EQ(scene.source.bytes(tile), bytesInMemory(scene.source.load(tile)));
    ++contents;
  }
  EXPECT_EQ(contents, 4);  // two blocks, one level above, the surround
  ASSERT_GE(scene.tree.surround, 0);
  EXPECT_TRUE(scene.source.load(scene.tree.surround).parts[0].surround);
}

TEST(VolumeScene, IsDrawnFromDiskAsFromMemory) {
  const VolumeScene scene = openVolumeScene(kScene);
  VolumeRendererSettings settings;
  settings.threads = 1;
  settings.selection.mostPixels = 0;
  VolumeRenderer renderer(scene.frame, scene.tree, scene.source, settings);
  const Pose pose = lookingAt(scene.frame, Vec3d(-3, -3, 2), Vec3d(0, 0, -0.3));
  const RenderedView view = renderer.render(camera(), pose, nullptr);

  std::vector<VolumeContent> finest;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    const TileNode& node = scene.tree.tiles[i];
    if (node.parent >= 0 && node.children.empty()) finest.push_back(scene.source.load(static_cast<int>(i)));
  }
  ASSERT_EQ(finest.size(), 2u);
  const VolumeContent surround = scene.source.load(scene.tree.surround);
  VolumeDrawing drawing{scene.frame, {&finest[0], &finest[1]}, &surround, {}};  // the first is nearer
  ThreadPool pool(1);
  const RenderedView expected = drawVolume(drawing, camera(), pose, nullptr, pool);
  EXPECT_EQ(view.colour.pixels, expected.colour.pixels);
  EXPECT_EQ(view.depth.pixels, expected.depth.pixels);
  double opacity = 0;
  for (const float value : view.opacity.pixels) opacity += value;
  EXPECT_GT(opacity / static_cast<double>(view.opacity.pixels.size()), 0.3);
}

TEST(VolumeScene, IsCoarserFromAfar) {
  const VolumeScene scene = openVolumeScene(kScene);
  VolumeRenderer renderer(scene.frame, scene.tree, scene.source, {});
  renderer.render(camera(), lookingAt(scene.frame, Vec3d(0, -300, 100), Vec3d::Zero()), nullptr);
  EXPECT_EQ(renderer.selection().cut.size(), 1u);
  EXPECT_EQ(renderer.cacheStatistics().loads, 2u);  // the root and the surround
}

TEST(VolumeScene, SaysWhatIsMissing) {
  try {
    openVolumeScene("/nowhere/scene");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere/scene"), std::string::npos);
  }
}

}  // namespace
}  // namespace tessera
