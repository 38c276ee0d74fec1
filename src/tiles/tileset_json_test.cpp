#include "tiles/tileset_json.h"

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "tiles/testing/test_tileset.h"

namespace tessera {
namespace {

using nlohmann::json;
using tiles_test::testTileset;

void expectSame(const Tileset& a, const Tileset& b) {
  EXPECT_EQ(encodeTileset(a), encodeTileset(b));  // covers every stored member, to the last digit
  EXPECT_EQ(a.worldFromScene.rotation, b.worldFromScene.rotation);
  EXPECT_EQ(a.sourceFromWorld, b.sourceFromWorld);
  EXPECT_EQ(a.background, b.background);
  EXPECT_EQ(a.coverage, b.coverage);
  EXPECT_EQ(a.exposureResponse, b.exposureResponse);
  ASSERT_EQ(a.tiles.size(), b.tiles.size());
  for (size_t i = 0; i < a.tiles.size(); ++i) {
    const Tile &one = a.tiles[i], &other = b.tiles[i];
    EXPECT_EQ(one.cells, other.cells);
    EXPECT_EQ(one.box.low, other.box.low);
    EXPECT_EQ(one.box.high, other.box.high);
    EXPECT_EQ(one.children, other.children);
    ASSERT_EQ(one.contents.size(), other.contents.size());
    for (size_t c = 0; c < one.contents.size(); ++c) {
      EXPECT_EQ(one.contents[c].uri, other.contents[c].uri);
      EXPECT_EQ(one.contents[c].backgroundBlock, other.contents[c].backgroundBlock);
      EXPECT_EQ(one.contents[c].level, other.contents[c].level);
      EXPECT_EQ(one.contents[c].geometricError, other.contents[c].geometricError);
      EXPECT_EQ(one.contents[c].resources, other.contents[c].resources);
      EXPECT_EQ(one.contents[c].bytes, other.contents[c].bytes);
      EXPECT_EQ(one.contents[c].cells, other.contents[c].cells);
    }
  }
}

TEST(TilesetJson, RoundTripsTilesets) {
  for (const bool georeferenced : {false, true}) {
    for (const auto representation : {"mesh", "volume", "hash"}) {
      Tileset tileset = testTileset(3, georeferenced);
      tileset.representation = representation;
      tileset.near = 0.1 + 0.2;  // no short decimal
      if (georeferenced) tileset.coverage = {{"block_1_0", 5000000000, 12}, {"block_0_0", 7, 0}};
      if (georeferenced) tileset.exposureResponse = {{0.4f, 0.5f, 0.6f}, {0.01f, -0.02f, 0}};
      std::string reason;
      const auto again = decodeTileset(encodeTileset(tileset), reason);
      ASSERT_TRUE(again) << reason;
      expectSame(tileset, *again);
    }
  }
}

TEST(TilesetJson, WritesThreeDTilesThatOtherProgramsRead) {
  const json file = json::parse(encodeTileset(testTileset()));
  EXPECT_EQ(file["asset"]["version"], "1.1");
  EXPECT_EQ(file["root"]["refine"], "REPLACE");
  EXPECT_EQ(file["extensionsUsed"], json::array({"TESSERA_scene"}));
  EXPECT_FALSE(file.contains("extensionsRequired"));
  EXPECT_EQ(file["root"]["transform"].size(), 16u);
  EXPECT_NEAR(file["root"]["transform"][12].get<double>(), 4035000,
              10000);  // column-major: the translation is at the end
  EXPECT_EQ(file["root"]["contents"].size(), 3u);
  const json& child = file["root"]["children"][0];
  EXPECT_TRUE(child.contains("content"));
  EXPECT_FALSE(child.contains("transform"));
  // A cell: half the edge of a finest block is 12.5 world units (worldFromScene), of 1.25 metres each.
  const auto box = child["boundingVolume"]["box"].get<std::vector<double>>();
  EXPECT_NEAR(Vec3d(box[3], box[4], box[5]).norm(), 12.5 * 1.25, 1e-9);
  EXPECT_NEAR(Vec3d(box[9], box[10], box[11]).norm(), 12.5 * 1.25 * 0.375, 1e-9);
}

TEST(TilesetJson, TheRootsVolumeHoldsTheBackgroundBlock) {
  const json file = json::parse(encodeTileset(testTileset(3, false)));
  const auto box = file["root"]["boundingVolume"]["box"].get<std::vector<double>>();
  EXPECT_NEAR(Vec3d(box[3], box[4], box[5]).norm(), 1000 * 12.5, 1e-6);
  EXPECT_EQ(file["root"]["extensions"]["TESSERA_scene"]["high"], json::array({3.0, 2.0, 0.75}));
}

TEST(TilesetJson, NamesTheSettingThatExceedsWhatReadersAccept) {
  const auto refuses = [](const std::string& why, const std::string& remedy, const std::function<void(Tileset&)>& set) {
    Tileset tileset = testTileset();
    set(tileset);
    try {
      encodeTileset(tileset);
      FAIL() << why;
    } catch (const Error& error) {
      EXPECT_EQ(error.subject(), "tileset.json");
      EXPECT_NE(std::string(error.what()).find(why), std::string::npos) << error.what();
      EXPECT_NE(error.remedy().find(remedy), std::string::npos) << error.what();
    }
  };
  refuses("near=1.5", "--set near", [](Tileset& tileset) { tileset.near = 1.5; });
  refuses("5000 by 2 blocks", "--blocks", [](Tileset& tileset) { tileset.columns = 5000; });
  refuses("2 by 5000 blocks", "--blocks", [](Tileset& tileset) {
    tileset.columns = 2;
    tileset.rows = 5000;
  });
  refuses("65537 tiles", "--blocks", [](Tileset& tileset) { tileset.tiles.resize(65537); });
  refuses("16777216 at most", "--blocks", [](Tileset& tileset) { tileset.name = std::string(size_t{16} << 20, 'x'); });
}

TEST(TilesetJson, IgnoresUnknownMembers) {
  json file = json::parse(encodeTileset(testTileset()));
  file["extras"] = 1;
  file["schema"] = {{"id", "x"}};
  file["root"]["metadata"] = {{"class", "y"}};
  file["extensions"]["TESSERA_scene"]["more"] = "z";
  std::string reason;
  EXPECT_TRUE(decodeTileset(file.dump(), reason)) << reason;
}

class TilesetJsonRefusal : public testing::Test {
 protected:
  // Expects that a changed tileset is refused with a reason that begins with `why`.
  void refuses(const std::string& why, const std::function<void(json&)>& spoil, const TilesetLimits& limits = {}) {
    json file = json::parse(encodeTileset(testTileset()));
    spoil(file);
    std::string reason;
    EXPECT_FALSE(decodeTileset(file.dump(), reason, limits)) << why;
    EXPECT_EQ(reason.substr(0, why.size()), why);
  }
  static json& ours(json& object) { return object["extensions"]["TESSERA_scene"]; }
};

TEST_F(TilesetJsonRefusal, RejectsWhatIsNoTileset) {
  std::string reason;
  EXPECT_FALSE(decodeTileset("", reason));
  EXPECT_EQ(reason, "is not a JSON object");
  EXPECT_FALSE(decodeTileset("[1, 2]", reason));
  EXPECT_FALSE(decodeTileset("{}", reason));
  EXPECT_EQ(reason, "is not 3D Tiles 1.1");
  EXPECT_FALSE(decodeTileset(std::string(100000, '['), reason));
  TilesetLimits limits;
  limits.textBytes = 10;
  EXPECT_FALSE(decodeTileset(encodeTileset(testTileset()), reason, limits));
  EXPECT_EQ(reason, "is larger than any tileset should be");
  refuses("is not 3D Tiles 1.1", [](json& file) { file["asset"]["version"] = "1.0"; });
  refuses("has no extension TESSERA_scene", [](json& file) { file.erase("extensions"); });
  refuses("requires extensions", [](json& file) { file["extensionsRequired"] = {"VENDOR_x"}; });
  refuses("has version 2; only 1 is supported", [](json& file) { ours(file)["version"] = 2; });
  refuses("does not state its version", [](json& file) { ours(file)["version"] = "1"; });
  refuses("does not name its representation", [](json& file) { ours(file)["representation"] = 7; });
  refuses("the representation's name is not valid", [](json& file) { ours(file)["representation"] = "Two words"; });
}

TEST_F(TilesetJsonRefusal, RejectsInvalidNumbers) {
  refuses("worldFromScene or", [](json& file) { ours(file)["worldFromScene"]["scale"] = "1"; });
  refuses("worldFromScene or", [](json& file) { ours(file)["worldFromScene"]["rotation"].erase(8); });
  refuses("worldFromScene or", [](json& file) { ours(file)["sourceFromWorld"][3] = nullptr; });
  refuses("worldFromScene's scale", [](json& file) { ours(file)["worldFromScene"]["scale"] = -1; });
  refuses("the georeference lacks", [](json& file) { ours(file)["georeference"].erase("altitude"); });
  refuses("the grid, levels", [](json& file) { ours(file)["grid"]["columns"] = -3; });
  refuses("the grid, levels", [](json& file) { ours(file)["grid"]["columns"] = 3.5; });
  refuses("the grid, levels", [](json& file) { ours(file)["near"] = true; });
  refuses("the grid's box", [](json& file) { ours(file)["grid"]["low"][0] = -2; });
  refuses("has no geometricError", [](json& file) { file.erase("geometricError"); });
  refuses("tile 1: its level", [](json& file) { file["root"]["children"][0].erase("geometricError"); });
  refuses("tile 1: its level", [](json& file) { ours(file["root"]["children"][0])["cells"][1] = -1; });
  refuses("tile 1: its level", [](json& file) { ours(file["root"]["children"][0])["cells"] = {0, 0, 1}; });
}

TEST_F(TilesetJsonRefusal, RejectsImpossibleExposureResponses) {
  const auto set = [](const json& value) { return [value](json& file) { ours(file)["exposureResponse"] = value; }; };
  refuses("the exposureResponse lacks numbers", set(3));
  refuses("the exposureResponse lacks numbers", set({{"slope", {1, 2, 3}}}));
  refuses("the exposureResponse lacks numbers", set({{"slope", {1, 2}}, {"offset", {0, 0, 0}}}));
  refuses("the exposureResponse is out of bounds", set({{"slope", {1, 2, 17}}, {"offset", {0, 0, 0}}}));
  refuses("the exposureResponse is out of bounds", set({{"slope", {1, 2, 3}}, {"offset", {0, 1e300, 0}}}));
}

TEST_F(TilesetJsonRefusal, RejectsImpossibleCoverage) {
  const json part = {{"part", "block_0_0"}, {"pixels", 10}, {"holes", 10}};
  const auto changed = [&](const char* key, const json& value) {
    json other = part;
    other[key] = value;
    return [other](json& file) { ours(file)["coverage"] = json::array({other}); };
  };
  refuses("the coverage is not a list", [&](json& file) { ours(file)["coverage"] = part; });
  refuses("the coverage is not a list", changed("part", "block_0_0"), {.coverage = 0});
  refuses("the coverage of a part lacks", changed("part", 3));
  refuses("the coverage of a part lacks", changed("pixels", -1));
  refuses("the coverage of a part lacks", changed("pixels", 1e300));
  refuses("the coverage of a part lacks", changed("holes", 0.5));
  refuses("the coverage of a part counts more holes than pixels", changed("holes", 11));
}

TEST_F(TilesetJsonRefusal, RejectsInconsistentTrees) {
  refuses("tile 1: has no extension", [](json& file) { file["root"]["children"][0].erase("extensions"); });
  refuses("tile 0: is not refined", [](json& file) { file["root"]["refine"] = "ADD"; });
  refuses("tile 2: is not refined", [](json& file) { file["root"]["children"][1]["refine"] = "ADD"; });
  refuses("tile 1: only the root", [](json& file) { file["root"]["children"][0]["transform"] = json::array(); });
  refuses("tile 0: its children are not a list", [](json& file) { file["root"]["children"] = 5; });
  refuses("tile 0: has both", [](json& file) { file["root"]["content"] = file["root"]["contents"][0]; });
  refuses("tile 0: a content has no uri", [](json& file) { file["root"]["contents"][0].erase("uri"); });
  refuses("tile 0: the key surround is called background_block now",
          [](json& file) { ours(file["root"]["contents"][0])["surround"] = true; });
  refuses("tile 0: a content's resources", [](json& file) { ours(file["root"]["contents"][0])["resources"] = {-1}; });
  refuses("tile 0: its children do not cover", [](json& file) { file["root"]["children"].erase(0); });
  refuses("tile 1: its boundingVolume",
          [](json& file) { file["root"]["children"][0]["boundingVolume"]["box"][0] = 9; });
  refuses("tile 1: its boundingVolume", [](json& file) { file["root"]["children"][0].erase("boundingVolume"); });
  refuses("tile 0: a content's boundingVolume",
          [](json& file) { file["root"]["contents"][1]["boundingVolume"]["box"][3] = 9; });
  TilesetLimits limits;
  limits.tiles = 6;
  refuses(
      "has too many tiles", [](json&) {}, limits);
  limits = {};
  limits.contentsOfTile = 1;
  refuses(
      "tile 0: has too many contents", [](json&) {}, limits);
  limits = {};
  limits.depth = 1;
  refuses(
      "tile 1: the tree is too deep", [](json&) {}, limits);
}

TEST_F(TilesetJsonRefusal, RejectsUrisThatLeaveTheFolder) {
  for (const char* uri :
       {"../a.glb", "/a.glb", "a/../../b.glb", "http://x/a.glb", "//x/a.glb", "a\\b.glb", "a%2e%2e.glb", "a.glb?x",
        "a b.glb", ".a.glb", "a//b.glb", "", "a.glb/", "tiles/./a.glb", "C:a.glb"}) {
    EXPECT_FALSE(isPlainUri(uri) && std::string_view(uri).ends_with(".glb")) << uri;
    refuses("tile 0: a content's uri", [&](json& file) { file["root"]["contents"][0]["uri"] = uri; });
  }
  EXPECT_TRUE(isPlainUri("tiles/L0/0_1-00ff.glb"));
  EXPECT_FALSE(isPlainUri(std::string(256, 'a')));
}

}  // namespace
}  // namespace tessera
