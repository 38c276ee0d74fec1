#include "render/tile_scene.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"
#include "representations/volume/content/volume_payload.h"
#include "representations/volume/testing/volume_renderer.h"
#include "tiles/scene_folder.h"
#include "tiles/tileset_json.h"

namespace tessera {
namespace {

const fs::path kScene = TESSERA_GOLDEN_VOLUME;

Camera smallCamera() {
  Camera camera;
  camera.width = 96;
  camera.height = 72;
  camera.parameters = {80, 80, 48, 36};
  return camera;
}

VolumeContent volumeAt(const TileScene& scene, int tile) {
  return contentAs<VolumeContent>(*scene.source.load(tile));
}

// Returns a pose in the world from positions in the scene.
Pose lookingAt(const TileFrame& frame, const Vec3d& eye, const Vec3d& target) {
  Pose pose;
  const Vec3d forward = (target - eye).normalized(), right = forward.cross(Vec3d::UnitZ()).normalized();
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.rotation = frame.rotation * pose.rotation;
  pose.translation = frame.scale * (frame.rotation * eye) + frame.translation;
  return pose;
}

TEST(TileScene, KnowsWhatContentsTakeInMemoryBeforeTheyAreLoaded) {
  const TileScene scene = openTileScene(kScene, volumeCodec());
  scene.tree.check();
  int contents = 0;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    if (!scene.tree.tiles[i].hasContent) continue;
    const int tile = static_cast<int>(i);
    EXPECT_EQ(scene.source.bytes(tile), scene.source.load(tile)->memoryBytes());
    ++contents;
  }
  EXPECT_EQ(contents, 5);  // two blocks, one level above, two background blocks
  ASSERT_GE(scene.tree.backgroundBlock, 0);
  const TileNode& coarse = scene.tree.tiles[scene.tree.backgroundBlock];
  ASSERT_EQ(coarse.children.size(), 1u);
  const int fine = coarse.children[0];
  EXPECT_EQ(coarse.level, 1);
  EXPECT_EQ(scene.tree.tiles[fine].level, 0);
  EXPECT_DOUBLE_EQ(coarse.geometricError, 2 * scene.tree.tiles[fine].geometricError);
  EXPECT_TRUE(volumeAt(scene, fine).parts[0].backgroundBlock);
  EXPECT_EQ(volumeAt(scene, fine).parts[0].planes, 2 * volumeAt(scene, scene.tree.backgroundBlock).parts[0].planes);
}

TEST(TileScene, RendersFromDiskAsFromMemory) {
  const TileScene scene = openTileScene(kScene, volumeCodec());
  SceneRendererSettings settings;
  settings.threads = 1;
  settings.selection.maximumScreenSpaceError = 0;
  VolumeRenderer renderer(scene.frame, scene.tree, scene.source, settings);
  const Pose pose = lookingAt(scene.frame, Vec3d(-3, -3, 2), Vec3d(0, 0, -0.3));
  const RenderedView view = renderer.render(smallCamera(), pose, nullptr);

  std::vector<VolumeContent> finest;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    const TileNode& node = scene.tree.tiles[i];
    if (!node.isBackgroundBlock && node.children.empty()) finest.push_back(volumeAt(scene, static_cast<int>(i)));
  }
  ASSERT_EQ(finest.size(), 2u);
  const VolumeContent backgroundBlock = volumeAt(scene, scene.tree.tiles[scene.tree.backgroundBlock].children.at(0));
  SceneDrawing<VolumeContent> drawing{
      scene.frame, {&finest[0], &finest[1]}, &backgroundBlock, {}};  // the first is nearer
  ThreadPool pool(1);
  const RenderedView expected = drawScene(drawing, smallCamera(), pose, nullptr, pool);
  EXPECT_EQ(view.colour.pixels, expected.colour.pixels);
  EXPECT_EQ(view.depth.pixels, expected.depth.pixels);
  double opacity = 0;
  for (const float value : view.opacity.pixels) opacity += value;
  EXPECT_GT(opacity / static_cast<double>(view.opacity.pixels.size()), 0.3);
}

TEST(TileScene, IsCoarserFromAfar) {
  const TileScene scene = openTileScene(kScene, volumeCodec());
  VolumeRenderer renderer(scene.frame, scene.tree, scene.source, {});
  renderer.render(smallCamera(), lookingAt(scene.frame, Vec3d(0, -300, 100), Vec3d::Zero()), nullptr);
  EXPECT_EQ(renderer.cut().tiles.size(), 1u);
  const int coarse = scene.tree.backgroundBlock, fine = scene.tree.tiles[coarse].children.at(0);
  EXPECT_TRUE(renderer.cache().holds(coarse));
  EXPECT_EQ(renderer.cut().backgroundBlock, fine);  // the camera is inside it
  EXPECT_EQ(renderer.cacheStatistics().loads, 3u);  // the root and the background blocks
}

TEST(TileScene, HasTheBackgroundBlockOfTheLevelThatIsAskedFor) {
  const TileScene scene = openTileScene(kScene, volumeCodec());
  SceneRendererSettings settings;
  settings.selection.maximumScreenSpaceError = 0;
  const int coarse = scene.tree.backgroundBlock, fine = scene.tree.tiles[coarse].children.at(0);
  for (const auto& [level, expected] : {std::pair(1, coarse), std::pair(0, fine)}) {
    settings.selection.finestLevel = level;
    VolumeRenderer renderer(scene.frame, scene.tree, scene.source, settings);
    const Pose pose = lookingAt(scene.frame, Vec3d(-3, -3, 2), Vec3d(0, 0, -0.3));
    const RenderedView view = renderer.render(smallCamera(), pose, nullptr);
    EXPECT_EQ(renderer.cut().backgroundBlock, expected);
    EXPECT_EQ(renderer.cache().holds(fine), level == 0);
  }
}

// A copy of the scene whose tileset.json can be made to disagree with its contents.
class InconsistentVolumeScene : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("tessera-lying-scene-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::copy(kScene, folder_, fs::copy_options::recursive);
    tileset_ = readTileset(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Loads the content of a tile, or the background block, and expects an error that names its file, its tile and the
  // rule.
  void refuses(bool backgroundBlock, size_t tile, const std::string& rule) {
    writeFileAtomically(folder_ / "tileset.json", encodeTileset(tileset_));
    const TileScene scene = openTileScene(folder_, volumeCodec());
    const int node =
        backgroundBlock ? scene.tree.tiles[scene.tree.backgroundBlock].children.at(0) : static_cast<int>(tile);
    try {
      scene.source.load(node);
      FAIL() << rule;
    } catch (const Error& error) {
      EXPECT_EQ(error.subject(), scene.source.file(node));
      EXPECT_EQ(error.place(), "of tile " + std::to_string(tile) + " in tileset.json");
      EXPECT_NE(error.reason().find(rule), std::string::npos) << error.what();
      EXPECT_FALSE(error.remedy().empty());
    }
  }

  fs::path folder_;
  Tileset tileset_;
};

TEST_F(InconsistentVolumeScene, IsRejectedWhereABackgroundBlockIsNotDeclaredAsSuchOrConversely) {
  std::vector<TileContent>& contents = tileset_.tiles[0].contents;
  ASSERT_TRUE(contents[1].backgroundBlock);
  std::swap(contents[0].uri, contents[1].uri);
  refuses(false, 0, "part 0 is a background block, and tileset.json says that the content is not");
  refuses(true, 0, "part 0 is not a background block, and tileset.json says that the content is one");
  // The renderer relies on it, and throws instead of rendering.
  const TileScene scene = openTileScene(folder_, volumeCodec());
  EXPECT_THROW(VolumeRenderer(scene.frame, scene.tree, scene.source, {}), Error);
}

TEST_F(InconsistentVolumeScene, IsRejectedWhereAPartLeavesTheBoxOfItsContent) {
  tileset_.tiles[2].contents[0].box.high.z() -= 1e-5;
  refuses(false, 2, "part 0 owns what lies outside of the content's box");
  tileset_ = readTileset(kScene);
  std::swap(tileset_.tiles[1].contents[0].uri, tileset_.tiles[2].contents[0].uri);
  refuses(false, 1, "part 0 owns what lies outside of the content's box");
  tileset_ = readTileset(kScene);
  tileset_.tiles[0].contents[1].box.low.x() = -9999;
  refuses(true, 0, "part 0 owns what lies outside of the content's box");
  tileset_ = readTileset(kScene);
  tileset_.tiles[2].contents[0].box.high.z() -= 1e-7;  // no more than rounding
  writeFileAtomically(folder_ / "tileset.json", encodeTileset(tileset_));
  EXPECT_EQ(volumeAt(openTileScene(folder_, volumeCodec()), 2).parts.size(), 1u);
}

// The format allows several contents in a tile, but the renderer does not support them.
TEST_F(InconsistentVolumeScene, IsRejectedWithSeveralContentsInATile) {
  std::vector<TileContent>& contents = tileset_.tiles[0].contents;
  contents.insert(contents.begin(), contents[0]);
  for (size_t i = 0; i < 2; ++i) {
    const uint32_t column = static_cast<uint32_t>(i);
    contents[i] = tileset_.tiles[i + 1].contents[0];
    contents[i].cells = {{column, 0}, {column + 1, 1}};
  }
  writeFileAtomically(folder_ / "tileset.json", encodeTileset(tileset_));
  try {
    openTileScene(folder_, volumeCodec());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), (folder_ / "tileset.json").string());
    EXPECT_EQ(error.place(), "tile 0");
    EXPECT_EQ(error.remedy(), "give each a tile of its own");
  }
}

TEST_F(InconsistentVolumeScene, IsRejectedWhereAFileExceedsTheSizeLimit) {
  const TileScene scene = openTileScene(folder_, volumeCodec());
  fs::resize_file(scene.source.file(1), (uint64_t{1} << 30) + 1);  // a sparse file
  try {
    scene.source.load(1);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), scene.source.file(1));
    EXPECT_NE(error.reason().find("1073741824 is the most"), std::string::npos) << error.what();
  }
  fs::resize_file(folder_ / "tileset.json", (uint64_t{16} << 20) + 1);
  try {
    openTileScene(folder_, volumeCodec());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), (folder_ / "tileset.json").string());
    EXPECT_NE(error.reason().find("16777216 is the most"), std::string::npos) << error.what();
  }
}

TEST(TileScene, NamesTheFolderWhoseCoarsestLevelDoesNotFit) {
  const TileScene scene = openTileScene(kScene, volumeCodec());
  SceneRendererSettings settings;
  settings.budgetBytes = 1000;
  try {
    VolumeRenderer(scene.frame, scene.tree, scene.source, settings);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), kScene.string());
  }
}

TEST(TileScene, NamesTheFolderThatIsMissing) {
  try {
    openTileScene("/nowhere/scene", volumeCodec());
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere/scene"), std::string::npos);
  }
}

}  // namespace
}  // namespace tessera
