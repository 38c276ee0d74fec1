// Contents of a codec made for these tests, which share resources and may overlap.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "base/error.h"
#include "base/testing/temporary_folder.h"
#include "render/scene_tiles.h"
#include "render/tile_scene.h"
#include "tiles/glb.h"
#include "tiles/scene_folder.h"
#include "tiles/testing/test_tileset.h"

namespace tessera {
namespace {

constexpr uint64_t kContentBytes = 100, kTableBytes = 5000;

struct Table final : Resource {
  explicit Table(int* alive) : alive(alive) { ++*alive; }
  ~Table() override { --*alive; }
  uint64_t memoryBytes() const override { return kTableBytes; }
  int* alive;
};

struct SharingContent final : Content {
  uint64_t memoryBytes() const override { return kContentBytes; }
  std::optional<std::string> mismatchWith(const TileContent&) const override { return std::nullopt; }
  Resources resources;
};

class SharingCodec final : public ContentCodec {
 public:
  std::string_view representation() const override { return "sharing"; }
  bool contentsMayOverlap() const override { return mayOverlap; }
  std::optional<uint64_t> memoryBytes(std::string_view, std::string&, const ContentLimits&) const override {
    return kContentBytes;
  }
  std::unique_ptr<Content> decode(std::span<const std::byte>, const Resources& resources, std::string&,
                                  const ContentLimits&) const override {
    auto content = std::make_unique<SharingContent>();
    content->resources = resources;
    return content;
  }
  uint64_t resourceMemoryBytes(const SharedResource&, uint64_t fileBytes) const override { return perByte * fileBytes; }
  std::shared_ptr<const Resource> decodeResource(std::span<const std::byte> bytes, const SharedResource& resource,
                                                 std::string& reason, const ContentLimits&) const override {
    EXPECT_EQ(resource.mimeType, "application/octet-stream");
    if (bytes.size() != kTableBytes / 1000) {
      reason = "is not a table";
      return nullptr;
    }
    ++decoded;
    return std::make_shared<Table>(&alive);
  }

  bool mayOverlap = false;
  uint64_t perByte = 1000;
  mutable int decoded = 0, alive = 0;
};

class SharedResources : public testing::Test {
 protected:
  // A root over two columns of two blocks, with two background blocks. The blocks share a table; the root and the
  // background blocks need none.
  void SetUp() override {
    const SceneFolderWriter writer(folder_.path());
    Tileset tileset = tiles_test::testTileset(2);
    tileset.representation = "sharing";
    const Bytes glb = encodeGlb("{}", Bytes(4));
    for (size_t i = 0; i < tileset.tiles.size(); ++i) {
      for (TileContent& content : tileset.tiles[i].contents) {
        content.uri = writer.addContent(tileset.tiles[i].level, "t" + std::to_string(i), glb);
        content.resources.clear();
        if (i > 0) content.resources = {0};
      }
    }
    tileset.resources[0].uri = writer.addResource("table", "bin", Bytes(kTableBytes / 1000));
    writer.commit(tileset);
    tileset_ = tileset;
  }

  const TemporaryFolder folder_;
  SharingCodec codec_;
  Tileset tileset_;
};

TEST_F(SharedResources, AreDecodedOnceAndStayResidentWhileAContentNeedsThem) {
  const TileScene scene = openTileScene(folder_.path(), codec_);
  EXPECT_EQ(scene.source.tileResources(0), std::vector<int>{});
  EXPECT_EQ(scene.source.tileResources(2), std::vector<int>{0});
  EXPECT_EQ(scene.source.bytesOfResource(0), kTableBytes);
  EXPECT_EQ(codec_.decoded, 0);
  auto first = scene.source.load(1), second = scene.source.load(2);
  EXPECT_EQ(codec_.decoded, 1);
  ASSERT_EQ(static_cast<SharingContent&>(*first).resources.size(), 1u);
  EXPECT_EQ(static_cast<SharingContent&>(*first).resources, static_cast<SharingContent&>(*second).resources);
  first.reset();
  EXPECT_EQ(codec_.alive, 1);
  second.reset();
  EXPECT_EQ(codec_.alive, 0);
  scene.source.load(3);
  EXPECT_EQ(codec_.decoded, 2);
}

TEST_F(SharedResources, CountOnceInTheBudgetOfWhatAViewIsDrawnFrom) {
  Camera camera;
  camera.width = 64;
  camera.height = 48;
  camera.parameters = {30, 30, 32, 24};
  const auto drawn = [&](uint64_t budget) {
    TileScene scene = openTileScene(folder_.path(), codec_);
    SceneTiles<Content> tiles(scene.frame, scene.tree, scene.source, {0, 1.2, 0}, budget);
    Pose pose;  // from above, looking down
    pose.rotation = scene.frame.rotation * Eigen::AngleAxisd(std::numbers::pi, Vec3d::UnitX()).toRotationMatrix();
    pose.translation = scene.frame.translation + scene.frame.scale * (scene.frame.rotation * Vec3d(0, 0, 6));
    tiles.loadFor(tileView(camera, pose, scene.frame));
    EXPECT_LE(tiles.cache().statistics().maxBytes, budget);
    EXPECT_EQ(codec_.alive, tiles.cache().statistics().bytes > kTableBytes ? 1 : 0);
    const std::vector<SelectedTile>& cut = tiles.cut().tiles;
    return std::count_if(cut.begin(), cut.end(), [](const SelectedTile& one) { return one.content > 0; });
  };
  const uint64_t pinned = 2 * kContentBytes,
                 backgroundBlock =
                     kContentBytes;  // the root and the coarse background block; the finer background block
  EXPECT_EQ(drawn(pinned + backgroundBlock + 4 * kContentBytes), 0);
  EXPECT_EQ(drawn(pinned + backgroundBlock + 4 * kContentBytes + kTableBytes), 4);
}

TEST_F(SharedResources, AreRefusedByTheNameOfTheirFile) {
  const fs::path file = contentPath(folder_.path(), tileset_.resources[0].uri);
  writeFileAtomically(file, Bytes(3));
  const TileScene scene = openTileScene(folder_.path(), codec_);
  try {
    scene.source.load(1);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), file.string());
    EXPECT_EQ(error.reason(), "is not a table");
    EXPECT_FALSE(error.remedy().empty());
  }
}

TEST_F(SharedResources, AreRefusedWhereTheyTakeMoreMemoryThanWasChargedForThem) {
  codec_.perByte = 999;
  const TileScene scene = openTileScene(folder_.path(), codec_);
  EXPECT_THROW(scene.source.load(1), Error);
  codec_.perByte = 1000;
  EXPECT_NO_THROW(scene.source.load(1));
}

// Loads one block after another with a budget for one: the table that they share stays in memory.
TEST_F(SharedResources, StayResidentWhenAContentReplacesAnotherThatNeedsThem) {
  TileScene scene = openTileScene(folder_.path(), codec_);
  TileCache<Content> cache(scene.tree, 2 * kContentBytes + kContentBytes + kTableBytes, scene.source);
  for (const int tile : {1, 2, 3, 1}) {
    cache.load(std::vector<int>{tile});
    EXPECT_TRUE(cache.holds(tile));
  }
  EXPECT_EQ(cache.statistics().evictions, 3u);
  EXPECT_EQ(codec_.decoded, 1);
}

TEST_F(SharedResources, RequireOrderedContentsUnlessTheirCodecLetsThemOverlap) {
  TileContent more = tileset_.tiles[1].contents[0];
  tileset_.tiles[1].contents.push_back(more);
  SceneFolderWriter(folder_.path()).commit(tileset_);
  const auto why = [&] {
    try {
      openTileScene(folder_.path(), codec_);
    } catch (const Error& error) {
      return error.place() + ": " + error.reason();
    }
    return std::string();
  };
  EXPECT_EQ(why(), "tile 1: contents of a tile have no order");
  codec_.mayOverlap = true;
  EXPECT_EQ(why(), "tile 1: has several contents, which the format allows and this renderer does not support");
}

}  // namespace
}  // namespace tessera
