#include "bake/scene_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "tiles/hash_payload.h"
#include "tiles/test_support.h"
#include "tiles/volume_payload.h"

namespace tessera {
namespace {

class SceneWriting : public testing::Test {
 protected:
  SceneWriting() : folder_(fs::temp_directory_path() / ("tessera-scene-writer-" + std::to_string(::getpid()))) {
    capture_.root = "/photos/town";
    grid_.columns = 2;
    grid_.rows = 1;
    grid_.bottom = -10;
    grid_.top = 10;
    grid_.edge = 20;
  }
  ~SceneWriting() override { fs::remove_all(folder_); }

  static HashContent cell(float x) {
    HashContent content = tiles_test::madeHashContent(3);
    content.parts[0].centre = {x, 0, 0};
    content.parts[0].low = {x - 1, -1, -1};
    content.parts[0].high = {x + 1, 1, 1};
    return content;
  }
  static HashContent surround() {
    HashContent content = cell(0);
    HashPart& part = content.parts[0];
    part.surround = part.contracted = true;
    part.scale = {2, 1, 1};
    part.low = {-1000, -1000, -1000};
    part.high = {1000, 1000, 1000};
    return content;
  }

  const fs::path folder_;
  Capture capture_;
  BlockGrid grid_;
};

TEST_F(SceneWriting, MakesATreeOfLevelsAndASurroundOfEach) {
  SceneWriter writer(folder_, capture_, grid_, {"hash", 0.1, {0.1f, 0.2f, 0.3f}});
  const HashContent left = cell(-1), right = cell(1), around = surround();
  HashContent both = left;
  both.parts.push_back(right.parts[0]);
  writer.beginLevel(64);
  writer.add({{0, 0}, {1, 1}}, encodeHash(left), summaryOf(left));
  writer.add({{1, 0}, {2, 1}}, encodeHash(right), summaryOf(right));
  writer.addSurround(encodeHash(around), summaryOf(around));
  writer.beginLevel(32);
  writer.add({{0, 0}, {2, 1}}, encodeHash(both), summaryOf(both));
  writer.addSurround(encodeHash(around), summaryOf(around));
  const BakedScene baked = writer.commit();
  const Tileset tileset = readTileset(folder_);
  EXPECT_EQ(tileset.representation, "hash");
  EXPECT_EQ(tileset.name, "town");
  EXPECT_EQ(tileset.background[2], 0.3f);
  EXPECT_EQ(tileset.near, 0.1);
  EXPECT_EQ(tileset.levels, 2u);
  ASSERT_EQ(tileset.tiles.size(), 3u);
  EXPECT_EQ(tileset.root().children.size(), 2u);
  EXPECT_EQ(tileset.root().contents.size(), 3u);
  EXPECT_NEAR(tileset.root().geometricError, 2.0 / 32 * 10, 1e-9);  // half an edge is 10
  EXPECT_NEAR(tileset.tiles[1].geometricError, 2.0 / 64 * 10, 1e-9);
  ASSERT_EQ(baked.levels.size(), 2u);
  EXPECT_EQ(baked.levels[1].bytesInMemory, bytesInMemory(both) + bytesInMemory(around));
  EXPECT_EQ(baked.levels[1].macroblocks, 2u * left.parts[0].storedMacroblocks() + around.parts[0].storedMacroblocks());
  EXPECT_EQ(baked.levels[0].bytesOnDisk,
            encodeHash(left).size() + encodeHash(right).size() + encodeHash(around).size());
}

TEST_F(SceneWriting, MakesARootWhereNothingStandsForAll) {
  SceneWriter writer(folder_, capture_, grid_, {"hash"});
  const HashContent left = cell(-1), right = cell(1);
  writer.beginLevel(64);
  writer.add({{0, 0}, {1, 1}}, encodeHash(left), summaryOf(left));
  writer.add({{1, 0}, {2, 1}}, encodeHash(right), summaryOf(right));
  const BakedScene baked = writer.commit();
  EXPECT_EQ(baked.levels.size(), 1u);
  const Tileset tileset = readTileset(folder_);
  EXPECT_EQ(tileset.levels, 2u);
  EXPECT_FALSE(tileset.root().hasContents());
  EXPECT_EQ(tileset.root().children.size(), 2u);
}

}  // namespace
}  // namespace tessera
