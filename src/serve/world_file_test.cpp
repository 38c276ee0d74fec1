#include "serve/world_file.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class WorldFileTest : public testing::Test {
 protected:
  WorldFileTest() {
    write("site/world.json", makeWorldText("old town.scene"));
    write("site/old town.scene/tileset.json", "{}");
    write("site/deep/tileset.json", "{}");
    write("site/.hidden/tileset.json", "{}");
    write("beside/tileset.json", "{}");
    fs::create_directory_symlink(folder_.path() / "beside", folder_.path() / "site/link");
    fs::create_directory_symlink("deep", folder_.path() / "site/inner");
  }

  static std::string makeWorldText(const std::string& url) {
    return fmt::format(R"({{"kind":"tessera world","version":2,"scenes":[{{"url":"deep/"}},{{"url":"{}"}}]}})", url);
  }
  void write(const std::string& name, const std::string& text) {
    const fs::path path = folder_.path() / name;
    fs::create_directories(path.parent_path());
    writeFileAtomically(path, text);
  }
  fs::path at(const std::string& name) const { return folder_.path() / name; }
  // Returns the error of a world file with this text; empty if it is valid.
  std::string said(const std::string& text) {
    write("site/world.json", text);
    return worldErrorMessage("site/world.json");
  }
  std::string worldErrorMessage(const std::string& name) const {
    try {
      requireWorld(at(name));
      return "";
    } catch (const Error& error) {
      return error.place() + ": " + error.reason();
    }
  }

  TemporaryFolder folder_;
};

TEST_F(WorldFileTest, IsAJsonFileOrTheWorldJsonOfAFolderThatIsNotAScene) {
  EXPECT_EQ(worldFileAt(at("site")), at("site/world.json"));
  EXPECT_EQ(worldFileAt(at("site/world.json")), at("site/world.json"));
  EXPECT_EQ(worldFileAt(at("site/deep")), std::nullopt);
  EXPECT_EQ(worldFileAt(at("nothing")), std::nullopt);
  write("site/deep/world.json", "{}");
  EXPECT_EQ(worldFileAt(at("site/deep")), std::nullopt) << "a folder with a tileset.json is a scene";
  EXPECT_EQ(worldFileAt(at("site/deep/world.json")), at("site/deep/world.json"));
}

TEST_F(WorldFileTest, AcceptsScenesInItsFolderAndOnOtherServers) {
  for (const char* url : {"old town.scene", "old%20town.scene/", "deep/tileset.json", "./deep", "a/../deep", "inner",
                          "deep?x#y", "https://example.com/garden.scene/", "//example.com/garden.scene", ""}) {
    EXPECT_EQ(said(makeWorldText(url)), "") << url;
  }
  write("site/tileset.json", "{}");
  EXPECT_EQ(said(makeWorldText(".")), "");
  EXPECT_EQ(said(makeWorldText("tileset.json")), "");
}

TEST_F(WorldFileTest, RejectsScenesOutsideItsFolder) {
  for (const char* url : {"../beside", "../beside/tileset.json", "/deep", "deep/../../beside", "%2e%2e/beside", "link",
                          "..%2fbeside", ".hidden", "deep%00", "%", "deep\\\\..\\\\..\\\\beside"}) {
    const std::string answer = said(makeWorldText(url));
    EXPECT_TRUE(answer.starts_with("scenes[1].url: '")) << url << ": " << answer;
    EXPECT_NE(answer.find(" does not lie in '" + fs::canonical(at("site")).string() + "'"), std::string::npos)
        << answer;
  }
  EXPECT_EQ(said(makeWorldText("nothing")),
            "scenes[1].url: there is no 'nothing/tileset.json' in '" + fs::canonical(at("site")).string() + "'");
  EXPECT_TRUE(said(R"({"kind":"tessera world","version":1,"scene":{"url":"../beside"}})").starts_with("scene.url: '"));
}

TEST_F(WorldFileTest, RejectsFilesThatWouldNotBeServed) {
  write("beside/world.json", makeWorldText("deep"));
  for (const char* name : {".world.json", "a\\b.json", "a\nb.json"}) {
    write(std::string("site/") + name, makeWorldText("deep"));
    EXPECT_EQ(worldErrorMessage(std::string("site/") + name), ": has a name that the server does not serve") << name;
  }
  write("site/a 50%.json", makeWorldText("deep"));
  EXPECT_EQ(worldErrorMessage("site/a 50%.json"), "");
  fs::create_symlink(at("beside/world.json"), at("site/out.json"));
  const std::string link = ": is a link to a file outside of '" + fs::canonical(at("site")).string() + "', or";
  EXPECT_TRUE(worldErrorMessage("site/out.json").starts_with(link)) << worldErrorMessage("site/out.json");
  fs::create_symlink("deep/inner.json", at("site/in.json"));
  write("site/deep/inner.json", makeWorldText("deep"));
  EXPECT_EQ(worldErrorMessage("site/in.json"), "");
  fs::create_symlink(".world.json", at("site/hidden.json"));
  EXPECT_TRUE(worldErrorMessage("site/hidden.json").starts_with(link)) << worldErrorMessage("site/hidden.json");
}

TEST_F(WorldFileTest, EscapesControlCharactersInErrors) {
  write("site/world.json", makeWorldText("\\u001b[2J\\u009b"));
  try {
    requireWorld(at("site/world.json"));
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("'\\x1b[2J\\u009b' does not lie in"), std::string::npos) << error.what();
  }
}

TEST_F(WorldFileTest, ReportsWhereItIsNotJson) {
  const auto reason = [](const std::string& place) { return place + ": is not JSON"; };
  EXPECT_EQ(said(""), reason("line 1, column 1"));
  EXPECT_EQ(said("{"), reason("line 1, column 2"));
  EXPECT_EQ(said("{\n"), reason("line 2, column 1"));
  EXPECT_EQ(said("{\n  \"kind\": \"tessera world\",\n  \"scenes\": [{\"url\": \"deep\"},]\n}\n"),
            reason("line 3, column 30"));
  EXPECT_EQ(said("{\n  \"name\": \"Köln ☀\" 3}"), reason("line 2, column 20")) << "columns are characters, not bytes";
  EXPECT_EQ(said(std::string(100000, '[')), reason("line 1, column 100001"));
  EXPECT_EQ(said(R"({"position": [1e999]})"), ": contains a number that is too large");
}

TEST_F(WorldFileTest, RequiresTheKindAndASupportedVersion) {
  for (const char* text : {"[]", "7", "{}", R"({"asset":{"version":"1.1"}})", R"({"kind":"world"})"}) {
    EXPECT_EQ(said(text), "kind: is not 'tessera world'") << text;
  }
  const auto ofVersion = [&](const std::string& version) {
    return said(R"({"kind":"tessera world","scenes":[{"url":"deep"}],"version":)" + version + "}");
  };
  for (const char* version : {"1", "2", "2.0"}) EXPECT_EQ(ofVersion(version), "") << version;
  for (const char* version : {"0", "3", "1.5", "\"2\"", "null", "true", "[2]"}) {
    EXPECT_EQ(ofVersion(version), "version: is neither 1 nor 2") << version;
  }
  EXPECT_EQ(said(R"({"kind":"tessera world","scenes":[{"url":"deep"}]})"), "version: is neither 1 nor 2");
}

TEST_F(WorldFileTest, RequiresScenesOfWhichOneIsTheMainOne) {
  const auto ofScenes = [&](const std::string& scenes) {
    return said(R"({"kind":"tessera world","version":2,"scenes":)" + scenes + "}");
  };
  const std::string deep = R"({"url":"deep"})";
  EXPECT_EQ(said(R"({"kind":"tessera world","version":2,"scene":{"url":"deep"}})"),
            "scenes: is missing, or not a list");
  for (const char* scenes : {"\"deep\"", "null", "{}"})
    EXPECT_EQ(ofScenes(scenes), "scenes: is missing, or not a list");
  EXPECT_EQ(ofScenes("[]"), "scenes: is empty");
  for (const char* scene : {"3", "null", "[]", "\"deep\""}) {
    EXPECT_EQ(ofScenes("[" + deep + "," + scene + "]"), "scenes[1]: is not an object");
  }
  std::string sixteen = deep;
  for (int i = 1; i < 16; ++i) sixteen += "," + deep;
  EXPECT_EQ(ofScenes("[" + sixteen + "]"), "");
  EXPECT_EQ(ofScenes("[" + sixteen + "," + deep + "]"), "scenes: are more than 16");

  const std::string noMain = "scenes: contains no scene without a placement, which would define the frame of the world";
  for (const char* place : {R"("position":[0,0,0])", R"("rotation":[0,0,0,1])", R"("scale":1)"}) {
    const std::string placed = std::string(R"({"url":"deep",)") + place + "}";
    EXPECT_EQ(ofScenes("[" + placed + "]"), noMain);
    EXPECT_EQ(ofScenes("[" + placed + "," + deep + "]"), "");
  }
}

TEST_F(WorldFileTest, RequiresNumbersForThePlacementOfScenes) {
  const auto ofPlace = [&](const std::string& place) {
    return said(R"({"kind":"tessera world","version":2,"scenes":[{"url":"deep"},{"url":"deep",)" + place + "}]}");
  };
  EXPECT_EQ(ofPlace(R"("position":[1,-2.5,3e2],"rotation":[0,0,0,1],"scale":2)"), "");
  for (const char* value : {"[1,2]", "[1,2,3,4]", "[1,2,\"3\"]", "[1,2,null]", "5", "null", "{}"}) {
    EXPECT_EQ(ofPlace(std::string(R"("position":)") + value), "scenes[1].position: is not 3 numbers") << value;
  }
  EXPECT_EQ(ofPlace(R"("rotation":[0,0,1])"), "scenes[1].rotation: is not 4 numbers");
  EXPECT_EQ(ofPlace(R"("scale":[1,1,1])"), "scenes[1].scale: is not a number");
}

TEST_F(WorldFileTest, IgnoresEverythingThatServingDoesNotNeed) {
  const std::string begin = R"({"kind":"tessera world","version":2,"scenes":[{"url":"deep"},{"url":4}],)";
  EXPECT_EQ(said(begin + R"("models":7,"files":{"a":"b"}})"), "");
  EXPECT_EQ(said(begin + R"("scene":{"url":"../beside"}})"), "");
  const std::string deepest = std::string(100000, '[') + std::string(100000, ']');
  EXPECT_EQ(said(R"({"kind":"tessera world","version":2,"scenes":[{"url":)" + deepest + "}]}"), "");
}

TEST_F(WorldFileTest, SuggestsToCorrectOrSaveItAgain) {
  for (const char* text : {"{", R"({"kind":"tessera world","version":2,"scenes":[{"url":"deep"},3]})"}) {
    write("site/world.json", text);
    try {
      requireWorld(at("site/world.json"));
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.remedy(), "correct it, or save it in the viewer again");
    }
  }
}

TEST_F(WorldFileTest, EncodesItsNameForTheViewer) {
  EXPECT_EQ(viewerOfWorld("world.json"), "?world=world/world.json");
  EXPECT_EQ(viewerOfWorld("my 50%.json"), "?world=world/my%252050%2525.json");
}

}  // namespace
}  // namespace tessera
