#include "tiles/scene_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"
#include "tiles/testing/test_tileset.h"
#include "tiles/tileset_json.h"

namespace tessera {
namespace {

class SceneFolder : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("tessera-scene-" + std::to_string(::getpid()));
    fs::remove_all(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  // Writes every content and resource of the test tileset, with bytes that contain `text`.
  Tileset bake(const std::string& text) {
    const SceneFolderWriter writer(root_);
    Tileset tileset = tiles_test::testTileset(2);
    const auto makeContentBytes = [&](size_t i, size_t j) {
      const std::string content = text + std::to_string(i) + "," + std::to_string(j);
      const auto raw = std::as_bytes(std::span(content.data(), content.size()));
      return Bytes(raw.begin(), raw.end());
    };
    for (size_t i = 0; i < tileset.tiles.size(); ++i) {
      for (size_t j = 0; j < tileset.tiles[i].contents.size(); ++j) {
        tileset.tiles[i].contents[j].uri = writer.addContent(
            tileset.tiles[i].level, "t" + std::to_string(i) + "_" + std::to_string(j), makeContentBytes(i, j));
      }
    }
    tileset.resources[0].uri = writer.addResource("table", "bin", makeContentBytes(99, 0));
    return tileset;
  }

  size_t files() const {
    size_t count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(root_)) count += entry.is_regular_file();
    return count;
  }

  fs::path root_;
};

TEST_F(SceneFolder, IsReadBack) {
  const Tileset tileset = bake("a");
  SceneFolderWriter(root_).commit(tileset);
  EXPECT_EQ(encodeTileset(readTileset(root_)), encodeTileset(tileset));
  const std::string& uri = tileset.tiles[1].contents[0].uri;
  EXPECT_EQ(uri.substr(0, 14), "tiles/L0/t1_0-");
  EXPECT_EQ(readTextFile(contentPath(root_, uri)), "a1,0");
}

TEST_F(SceneFolder, KnowsWhetherAFileHoldsWhatWasWritten) {
  const Tileset tileset = bake("a");
  for (const std::string& uri : {tileset.tiles[1].contents[0].uri, tileset.resources[0].uri}) {
    const fs::path file = contentPath(root_, uri);
    Bytes bytes = readFile(file);
    EXPECT_TRUE(hasItsDigest(file, bytes)) << uri;
    bytes.back() ^= std::byte{1};
    EXPECT_FALSE(hasItsDigest(file, bytes)) << uri;
    EXPECT_TRUE(hasItsDigest(root_ / "tile.glb", bytes)) << "its name contains no digest";
    bytes.pop_back();
    EXPECT_FALSE(hasItsDigest(file, bytes)) << uri;
  }
}

TEST_F(SceneFolder, IsTheOldSceneUntilTheNewOneIsWhole) {
  const Tileset before = bake("old");
  SceneFolderWriter(root_).commit(before);
  const size_t count = files();
  const Tileset after = bake("new");  // if the process were killed before its commit, the old scene would remain
  EXPECT_EQ(encodeTileset(readTileset(root_)), encodeTileset(before));
  EXPECT_EQ(readTextFile(contentPath(root_, before.tiles[2].contents[0].uri)), "old2,0");
  SceneFolderWriter(root_).commit(after);
  EXPECT_EQ(readTextFile(contentPath(root_, readTileset(root_).tiles[2].contents[0].uri)), "new2,0");
  EXPECT_EQ(files(), count);  // no file of the old scene is left
}

TEST_F(SceneFolder, RemovesWhatAKilledRunLeftAndNothingOfOthers) {
  writeFileAtomically(root_ / "tiles/L0/x-0123456789abcdef.glb.partial-77", std::string_view("half"));
  writeFileAtomically(root_ / "tiles/L0/x-0123456789abcdef.glb", std::string_view("never named"));
  writeFileAtomically(root_ / "tiles/holiday.jpg", std::string_view("theirs"));
  SceneFolderWriter(root_).commit(bake("a"));
  EXPECT_FALSE(fs::exists(root_ / "tiles/L0/x-0123456789abcdef.glb.partial-77"));
  EXPECT_FALSE(fs::exists(root_ / "tiles/L0/x-0123456789abcdef.glb"));
  EXPECT_TRUE(fs::exists(root_ / "tiles/holiday.jpg"));
}

TEST_F(SceneFolder, KeepsTheBytesOfContentsThatStayTheSame) {
  const Tileset before = bake("same"), after = bake("same");
  EXPECT_EQ(encodeTileset(before), encodeTileset(after));
}

TEST_F(SceneFolder, RefusesToCommitWithoutAContent) {
  const Tileset tileset = bake("a");
  fs::remove(root_ / tileset.tiles[1].contents[0].uri);
  EXPECT_THROW(SceneFolderWriter(root_).commit(tileset), Error);
  EXPECT_FALSE(fs::exists(root_ / "tileset.json"));
}

TEST_F(SceneFolder, NamesWhatIsWrongWithIt) {
  EXPECT_THROW(readTileset(root_), Error);
  const Tileset tileset = bake("a");
  SceneFolderWriter(root_).commit(tileset);
  const std::string& uri = tileset.tiles[1].contents[0].uri;
  fs::remove(root_ / uri);
  try {
    readTileset(root_);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.place(), uri);
  }
  writeFileAtomically(root_ / "tileset.json", std::string_view("{}"));
  try {
    readTileset(root_);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "is not 3D Tiles 1.1");
  }
}

TEST_F(SceneFolder, RefusesALinkThatLeadsOut) {
  const Tileset tileset = bake("a");
  SceneFolderWriter(root_).commit(tileset);
  const fs::path content = root_ / tileset.tiles[1].contents[0].uri;
  fs::remove(content);
  fs::create_symlink("/etc/hostname", content);
  EXPECT_THROW(readTileset(root_), Error);
}

}  // namespace
}  // namespace tessera
