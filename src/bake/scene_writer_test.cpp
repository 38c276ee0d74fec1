#include "bake/scene_writer.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

Bytes makeBytes(const std::string& text) {
  const auto raw = std::as_bytes(std::span(text.data(), text.size()));
  return Bytes(raw.begin(), raw.end());
}

class SceneWriting : public testing::Test {
 protected:
  SceneWriting() {
    capture_.root = "/photos/town";
    about_.representation = "hash";
    about_.near = 0.1;
    about_.background = {0.1f, 0.2f, 0.3f};
    about_.grid.columns = 2;
    about_.grid.rows = 1;
    about_.grid.bottom = -10;
    about_.grid.top = 10;
    about_.grid.edge = 20;
  }

  // Summarises a content whose cells are `width` wide around x, baked from a grid of `texels`.
  static ContentSummary around(double x, double width, double texels) {
    ContentSummary content;
    content.box = {{x - width / 2, -1, -1}, {x + width / 2, 1, 1}};
    content.geometricError = 2.0 / texels;
    content.memoryBytes = static_cast<uint64_t>(1000 * texels);
    content.counts = {{"macroblocks", 5}};
    return content;
  }
  static ContentSummary background(double texels) {
    ContentSummary content;
    content.box = {Vec3d::Constant(-1000), Vec3d::Constant(1000)};
    content.isBackground = true;
    content.geometricError = 8.0 / texels;
    content.memoryBytes = 7;
    content.counts = {{"macroblocks", 2}};
    return content;
  }

  const TemporaryFolder folder_;
  Capture capture_;
  SceneDescription about_;
};

constexpr CellRange kLeft = {{0, 0}, {1, 1}}, kRight = {{1, 0}, {2, 1}}, kBoth = {{0, 0}, {2, 1}};

// Returns the error of the constructor, for people.
std::string refusal(const fs::path& folder, const Capture& capture, const SceneDescription& about) {
  try {
    const SceneWriter writer(folder, capture, about);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST_F(SceneWriting, IsRefusedBeforeThereAreContents) {
  capture_.sourceFromWorld(3, 3) = 0.5;
  EXPECT_NE(refusal(folder_ / "scene", capture_, about_).find("town/transforms.json"), std::string::npos);
  capture_.sourceFromWorld(3, 3) = 1;
  about_.near = 1.5;
  EXPECT_NE(refusal(folder_ / "scene", capture_, about_).find("--set near"), std::string::npos);
  about_.near = 0.1;
  EXPECT_EQ(refusal(folder_ / "scene", capture_, about_), "");
  writeFileAtomically(folder_ / "file", "x");
  EXPECT_NE(refusal(folder_ / "file/scene", capture_, about_).find("cannot be written"), std::string::npos);
}

TEST_F(SceneWriting, GivesTheSceneItsName) {
  for (const char* name : {"", "harbour"}) {
    about_.name = name;
    SceneWriter writer(folder_ / "scene", capture_, about_);
    writer.add(0, kBoth, makeBytes("both"), around(0, 4, 32));
    EXPECT_EQ(writer.commit().tileset.name, *name == 0 ? "town" : name);
  }
}

TEST_F(SceneWriting, MakesATreeOfLevelsAndABackgroundOfEach) {
  SceneWriter writer(folder_ / "scene", capture_, about_);
  // A model that holds all levels may add those of one block in sequence.
  writer.add(0, kLeft, makeBytes("left"), around(-1, 2, 64));
  writer.add(1, kBoth, makeBytes("both, coarser"), around(0, 4, 32));
  writer.add(1, std::nullopt, makeBytes("all around, coarser"), background(32));
  writer.add(0, kRight, makeBytes("right"), around(1, 2, 64));
  writer.add(0, std::nullopt, makeBytes("all around"), background(64));
  const BakedScene baked = writer.commit();
  const Tileset tileset = readTileset(folder_ / "scene");
  EXPECT_EQ(tileset.representation, about_.representation);
  EXPECT_EQ(tileset.name, "town");
  EXPECT_EQ(tileset.background[2], 0.3f);
  EXPECT_EQ(tileset.near, 0.1);
  EXPECT_EQ(tileset.levels, 2u);
  ASSERT_EQ(tileset.tiles.size(), 3u);
  EXPECT_EQ(tileset.root().children.size(), 2u);
  ASSERT_EQ(tileset.root().contents.size(), 3u);
  EXPECT_NEAR(tileset.root().geometricError, 2.0 / 32 * 10, 1e-9);  // half an edge is 10 metres
  EXPECT_NEAR(tileset.tiles[1].geometricError, 2.0 / 64 * 10, 1e-9);
  EXPECT_NEAR(tileset.root().contents[1].geometricError, 8.0 / 64 * 10, 1e-9);
  EXPECT_EQ(tileset.root().contents[2].level, 1u);
  EXPECT_EQ(readTextFile(contentPath(folder_ / "scene", tileset.tiles[2].contents.at(0).uri)), "right");
  EXPECT_EQ(tileset.tiles[2].contents[0].box.low.x(), 0);
  EXPECT_EQ(baked.tileset.tiles.size(), 3u);
  ASSERT_EQ(baked.levels.size(), 2u);
  EXPECT_EQ(baked.levels[1].bytesInMemory, 32007u);
  EXPECT_EQ(baked.levels[0].counts, (decltype(BakedLevel::counts){{"macroblocks", 12}}));
  EXPECT_EQ(baked.levels[0].bytesOnDisk, std::string("leftrightall around").size());
}

TEST_F(SceneWriting, AddsARootWhereNoTileCoversEverything) {
  SceneWriter writer(folder_ / "scene", capture_, about_);
  writer.add(0, kLeft, makeBytes("left"), around(-1, 2, 64));
  writer.add(0, kRight, makeBytes("right"), around(1, 2, 64));
  const BakedScene baked = writer.commit();
  EXPECT_EQ(baked.levels.size(), 1u);
  const Tileset tileset = readTileset(folder_ / "scene");
  EXPECT_EQ(tileset.levels, 2u);
  EXPECT_FALSE(tileset.root().hasContents());
  EXPECT_EQ(tileset.root().children.size(), 2u);
}

TEST_F(SceneWriting, WritesSharedResourcesOnceAndRecordsTheirUsers) {
  SceneWriter writer(folder_ / "scene", capture_, about_);
  const uint32_t network = writer.addResource("network", "application/octet-stream", makeBytes("weights"));
  const uint32_t texture = writer.addResource("texture", "image/webp", makeBytes("texels"));
  EXPECT_EQ(writer.addResource("network", "application/octet-stream", makeBytes("weights")), network);
  EXPECT_NE(network, texture);
  writer.add(0, kLeft, makeBytes("left"), around(-1, 2, 64), {network, texture});
  writer.add(0, kRight, makeBytes("right"), around(1, 2, 64), {network});
  writer.commit();
  const Tileset tileset = readTileset(folder_ / "scene");
  ASSERT_EQ(tileset.resources.size(), 2u);
  const SharedResource& shared = tileset.resources[network];
  EXPECT_EQ(shared.mimeType, "application/octet-stream");
  EXPECT_EQ(shared.bytes, std::string("weights").size());
  EXPECT_TRUE(shared.uri.starts_with("resources/network-") && shared.uri.ends_with(".bin")) << shared.uri;
  EXPECT_TRUE(tileset.resources[texture].uri.ends_with(".webp")) << tileset.resources[texture].uri;
  EXPECT_EQ(readTextFile(contentPath(folder_ / "scene", shared.uri)), "weights");
  EXPECT_EQ(tileset.tiles[1].contents.at(0).resources, (std::vector<uint32_t>{network, texture}));
  EXPECT_EQ(tileset.tiles[2].contents.at(0).resources, (std::vector<uint32_t>{network}));
}

// A baker, independent of any representation.
class OneContent final : public Baker {
 public:
  explicit OneContent(const SceneDescription& about) : about_(about) {}
  SceneDescription description() const override { return about_; }
  void bake(const Capture&, const BakeOptions& options, ContentSink& sink) override {
    sink.add(0, kBoth, makeBytes("fine" + std::to_string(options.effort)), ContentSummary{.geometricError = 0.1});
  }

 private:
  SceneDescription about_;
};

TEST_F(SceneWriting, UsesTheRequestedBackgroundOrElseTheBakers) {
  OneContent baker(about_);
  BakeOptions options;
  options.effort = 7;
  const BakedScene baked = bakeScene(baker, capture_, folder_ / "scene", options);
  EXPECT_EQ(readTileset(folder_ / "scene").background, about_.background);
  EXPECT_EQ(readTextFile(contentPath(folder_ / "scene", baked.tileset.root().contents.at(0).uri)), "fine7");
  options.background = {0.5f, 0.25f, 0.75f};
  bakeScene(baker, capture_, folder_ / "scene", options);
  EXPECT_EQ(readTileset(folder_ / "scene").background, *options.background);
}

TEST_F(SceneWriting, RecordsTheCoverageThatTheBakerStates) {
  OneContent unchecked(about_);
  bakeScene(unchecked, capture_, folder_ / "scene", {});
  EXPECT_TRUE(readTileset(folder_ / "scene").coverage.empty());
  about_.coverage = {{"block_0_0", 100, 3}, {"block_1_0", 50, 0}};
  OneContent checked(about_);
  bakeScene(checked, capture_, folder_ / "scene", {});
  EXPECT_EQ(readTileset(folder_ / "scene").coverage, about_.coverage);
}

}  // namespace
}  // namespace tessera
