#include "world/world_file.h"

#include <gtest/gtest.h>

#include <numbers>

#include "base/error.h"
#include "base/testing/temporary_folder.h"
#include "world/world_text.h"

namespace tessera {
namespace {

constexpr const char* kTown = R"({"kind": "tessera world", "version": 2, "scenes": [{"url": "town"}])";

std::string worldWith(const std::string& more) {
  return kTown + (more.empty() ? "" : ", " + more) + "}";
}

// Returns "place: reason" of the refusal; empty if there is none.
std::string refusalAt(const std::string& text) {
  try {
    decodeWorld(text, "world.json");
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), "world.json");
    return error.place() + ": " + error.reason();
  }
  return "";
}

TEST(WorldFile, IsReadCompletely) {
  const World world = decodeWorld(R"({"kind": "tessera world", "version": 2,
    "scenes": [
      {"name": "Old town", "url": "old%20town.scene/tileset.json"},
      {"url": "harbour", "position": [420, -35, 2], "rotation": [0, 0, 0.7071068, 0.7071068], "scale": 2, "visible": false}],
    "models": [{"name": "bus", "files": ["a/bus.glb"], "contents": ["7 ab"], "position": [12, 30, 1.5],
                "rotation": [0, 0, 0, 1], "scale": [1, 2, 3]}],
    "hidden": [{"name": "crane", "middle": [80, 12, 20], "size": [10, 10, 40], "turn": 0.3, "hides": false}],
    "bookmarks": [{"name": "Square", "view": "eye=40,-60,30&target=0,0,0&fov=35"}],
    "files": {"a/bus.glb": "Z2xURg=="}, "other": 1})",
                                  "world.json");
  ASSERT_EQ(world.scenes.size(), 2u);
  EXPECT_FALSE(world.scenes[0].placement);
  EXPECT_TRUE(world.scenes[0].isVisible);
  ASSERT_TRUE(world.scenes[1].placement);
  EXPECT_FALSE(world.scenes[1].isVisible);
  EXPECT_EQ(world.scenes[1].placement->scale, 2);
  EXPECT_EQ(world.scenes[1].placement->position, Vec3d(420, -35, 2));
  EXPECT_TRUE((world.scenes[1].placement->rotation * Vec3d::UnitX()).isApprox(Vec3d::UnitY(), 1e-6));
  ASSERT_EQ(world.models.size(), 1u);
  EXPECT_EQ(world.models[0].scale, Vec3d(1, 2, 3));
  ASSERT_EQ(world.hidden.size(), 1u);
  EXPECT_FALSE(world.hidden[0].hides);
  ASSERT_EQ(world.bookmarks.size(), 1u);
  EXPECT_EQ(world.bookmarks[0].eye, Vec3d(40, -60, 30));
  EXPECT_EQ(world.bookmarks[0].fieldOfView, 35);
  ASSERT_EQ(world.files.size(), 1u);
  EXPECT_EQ(world.files.at("a/bus.glb").size(), 4u);
}

TEST(WorldFile, OfTheFirstVersionHasOneScene) {
  const World world =
      decodeWorld(R"({"kind": "tessera world", "version": 1, "scene": {"name": "town", "url": "town"}, "models": []})",
                  "world.json");
  ASSERT_EQ(world.scenes.size(), 1u);
  EXPECT_EQ(world.scenes[0].url, "town");
  EXPECT_EQ(refusalAt(R"({"kind": "tessera world", "version": 1, "scene": {"url": "town"}})"), "models: is not a list");
}

TEST(WorldFile, CountsCharactersAsTheBrowserDoes) {
  const auto place = [](const std::string& character, size_t count) {
    std::string name;
    for (size_t i = 0; i < count; ++i) name += character;
    return refusalAt(worldWith(R"("bookmarks": [{"view": "eye=1,2,3&target=4,5,6", "name": ")" + name + "\"}]"));
  };
  for (const auto& [character, most] : {std::pair("a", 1000u), std::pair("ä", 1000u), std::pair("🏙", 500u)}) {
    EXPECT_EQ(place(character, most), "") << character;
    EXPECT_EQ(place(character, most + 1), "bookmarks[0].name: is too long") << character;
  }
}

TEST(WorldFile, HasBookmarksAsTheBrowserWritesAddresses) {
  const auto read = [](const std::string& view) {
    return decodeWorld(worldWith(R"("bookmarks": [{"name": "a", "view": ")" + view + "\"}]"), "world.json")
        .bookmarks[0];
  };
  for (const char* view : {"eye=40,-60,30&target=0,0,0&fov=35", "#eye= 40, -60,+30&target=0,0,0&fov=35+",
                           "target=0%2C0%2C0&eye=40%2C-60%2C30&fov=35"}) {
    EXPECT_EQ(read(view).eye, Vec3d(40, -60, 30)) << view;
    EXPECT_EQ(read(view).fieldOfView, 35) << view;
  }
  EXPECT_EQ(read("eye=999999999,0,0&target=0,0,0&fov=121").eye.x(), 999999999);
  EXPECT_EQ(read("eye=1,0,0&target=0,0,0&fov=121").fieldOfView, 50);
  EXPECT_THROW(read("eye=1e9,0,0&target=0,0,0"), Error);
}

TEST(WorldFile, ShowsWhatIsNotSaidToBeHidden) {
  const World world = decodeWorld(
      worldWith(R"("hidden": [{"name": "a", "middle": [0, 0, 0], "size": [1, 1, 1], "turn": -1000, "hides": "no"}])"),
      "world.json");
  EXPECT_TRUE(world.hidden[0].hides);
  EXPECT_EQ(world.hidden[0].turn, -1000);
}

TEST(WorldFile, IsRefusedWithThePlaceOfWhatIsWrong) {
  EXPECT_EQ(refusalAt(worldWith("")), "");
  EXPECT_EQ(refusalAt("{\n \"kind\": }"), "line 2, column 10: is not JSON");
  EXPECT_EQ(refusalAt("[]"), "kind: is not 'tessera world'");
  EXPECT_EQ(refusalAt(R"({"kind": "tessera world", "version": 3})"), "version: is neither 1 nor 2");
  EXPECT_EQ(refusalAt(R"({"kind": "tessera world", "version": 2, "scenes": [{"url": "a", "scale": 1}]})"),
            "scenes: contains no scene without a placement, which would define the frame of the world");
  const std::string model = R"("models": [{"name": "a", "files": ["a.glb"], "position": [0, 0, 0], )";
  EXPECT_EQ(refusalAt(worldWith(model + R"("rotation": [0, 0, 0, 2], "scale": [1, 1, 1]}])")),
            "models[0].rotation: has a number beyond 1.01");
  EXPECT_EQ(refusalAt(worldWith(model + R"("rotation": [0, 0, 0.5, 0.5], "scale": [1, 1, 1]}])")),
            "models[0].rotation: is not a rotation");
  EXPECT_EQ(refusalAt(worldWith(model + R"("rotation": [0, 0, 0, 1], "scale": [1, 0, 1]}])")),
            "models[0].scale: is not above 1e-06");
  for (const char* name : {"file:a.glb", "data:,a", "//example.org/a.glb", R"(\\\\a\\b.glb)", ""}) {
    EXPECT_EQ(refusalAt(worldWith(R"("models": [{"files": [")" + std::string(name) + R"("]}])")),
              "models[0].files: has an invalid name")
        << name;
  }
  EXPECT_EQ(refusalAt(worldWith(R"("models": [{"files": ["HTTPS://example.org/a.glb", "3d:a.mtl"]}])")),
            "models[0].name: is missing");
  EXPECT_EQ(refusalAt(R"({"kind": "tessera world", "version": 2, "scenes": [{"url": "ftp://a"}]})"),
            "scenes[0].url: is neither an address of http or https nor a relative one");
  EXPECT_EQ(refusalAt(R"({"kind": "tessera world", "version": 2})"), "scenes: is not a list");
  EXPECT_EQ(refusalAt(worldWith(R"("hidden": [{"name": "a", "middle": [0, 0, 0], "size": [1, 1, 1], "turn": 1001}])")),
            "hidden[0].turn: is beyond 1000");
  EXPECT_EQ(refusalAt(worldWith(R"("models": [{"files": []}])")), "models[0].files: names no files, or too many");
  EXPECT_EQ(refusalAt(worldWith(R"("models": [7])")), "models[0]: is not an object");
  EXPECT_EQ(refusalAt(worldWith(R"("hidden": [{"name": "a", "middle": [0, 1e8, 0]}])")),
            "hidden[0].middle: has a number beyond 10000000");
  EXPECT_EQ(refusalAt(worldWith(R"("hidden": [0,0,0,0,0,0,0,0,0])")), "hidden: are more than 8");
  EXPECT_EQ(refusalAt(worldWith(R"("bookmarks": [{"name": "a", "view": "eye=1,2&target=0,0,0"}])")),
            "bookmarks[0].view: is not a view such as eye=x,y,z&target=x,y,z");
  EXPECT_EQ(refusalAt(worldWith(R"("files": {"a": "%"})")), "files[\"a\"]: is not base64");
}

TEST(WorldFile, ReadsBase64ToItsEnd) {
  const auto decoded = [](const std::string& text) {
    const auto bytes = decodeBase64(text);
    return bytes ? std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()) : "refused";
  };
  EXPECT_EQ(decoded(""), "");
  EXPECT_EQ(decoded("YQ=="), "a");
  EXPECT_EQ(decoded("YWI="), "ab");
  EXPECT_EQ(decoded("YWJj\nZA"), "abcd");
  for (const char* wrong : {"Y", "Y===", "YQ=a", "Y-Q=", "YWI=="}) EXPECT_EQ(decoded(wrong), "refused") << wrong;
}

TEST(WorldFile, NamesScenesByAddressesInItsFolder) {
  TemporaryFolder folder;
  const fs::path file = folder / "world.json";
  writeFileAtomically(folder / "old town/tileset.json", std::string_view("{}"));
  EXPECT_FALSE(findWorldFile(folder.path()));
  writeFileAtomically(file, std::string_view("{}"));
  EXPECT_EQ(findWorldFile(folder.path()), file);
  EXPECT_EQ(findWorldFile(file), file);
  WorldScene scene;
  for (const char* url : {"old%20town", "./old town/", "old town/tileset.json?a=b"}) {
    scene.url = url;
    EXPECT_TRUE(fs::exists(resolveScene(file, scene, "scenes[0]") / "tileset.json")) << url;
  }
  for (const char* url : {"", "https://example.org/a.scene", "//example.org/a", "/old town", "missing"}) {
    scene.url = url;
    EXPECT_THROW(resolveScene(file, scene, "scenes[0]"), Error) << url;
  }
}

}  // namespace
}  // namespace tessera
