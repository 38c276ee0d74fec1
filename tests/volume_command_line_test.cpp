// The program as people use it on large places: blocks, tiles, and what it says when something is wrong with them.
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "tests/program.h"

namespace tessera {
namespace {

using nlohmann::json;

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// Settings that make a model in a moment.
const std::vector<std::string> kTiny = {
    "voxels=16",          "planes=32",         "grid_levels=4",        "grid_log2_size=10",  "grid_finest=32",
    "width=16",           "proposal_levels=3", "proposal_log2_size=8", "proposal_finest=16", "first_intervals=12",
    "second_intervals=8", "samples=8",         "texels_per_step=8192", "first_rays=64",      "most_rays=512",
    "sparsity_points=128"};

class VolumeCommandLine : public testing::Test {
 protected:
  // One city for all tests.
  static void SetUpTestSuite() {
    folder_ = fs::weakly_canonical(fs::temp_directory_path()) / ("tessera-volume-line-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const Said said = run({"synth", "city", at("city"), "--blocks", "1x1", "--photos", "10", "--size", "48x36",
                           "--samples", "1", "--seed", "3"});
    ASSERT_EQ(said.exitCode, 0) << said.err;
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static Said run(const std::vector<std::string>& arguments) { return Program(folder_, arguments).wait(); }
  static std::string at(const std::string& name) { return (folder_ / name).string(); }

  static std::vector<std::string> trainArguments(const std::string& model, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"train", at("city"), model, "--method", "volume", "--blocks", "2x1"};
    for (const std::string& setting : kTiny) arguments.insert(arguments.end(), {"--set", setting});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  // A model and its scene, made once.
  static std::string model() {
    const std::string made = at("model");
    if (!fs::exists(made)) {
      const Said said = run(trainArguments(made, {"--steps", "40"}));
      EXPECT_EQ(said.exitCode, 0) << said.err;
    }
    return made;
  }
  static std::string scene() {
    const std::string made = at("scene");
    if (!fs::exists(made)) {
      const Said said = run({"bake", model(), made});
      EXPECT_EQ(said.exitCode, 0) << said.err;
      EXPECT_TRUE(contains(said.out, "macroblocks")) << said.out;
    }
    return made;
  }
  static std::vector<Bytes> checkpoints(const std::string& model) {
    const json manifest = json::parse(readTextFile(fs::path(model) / "manifest.json"));
    std::vector<Bytes> files;
    for (const json& file : manifest.at("files")) files.push_back(readFile(fs::path(model) / file.get<std::string>()));
    return files;
  }
  static inline fs::path folder_;
};

TEST_F(VolumeCommandLine, GoesTheWholeWayFromACityToThePicturesOfAScene) {
  for (const char* file : {"blocks.svg", "blocks.geojson", "blocks.json", "config.toml"}) {
    EXPECT_TRUE(fs::exists(fs::path(model()) / file)) << file;
  }
  EXPECT_EQ(checkpoints(model()).size(), 3u) << "two blocks and the surround";
  for (const std::string& what : {model(), scene()}) {
    const Said said = run({"eval", what, at("city"), "--json", at("eval.json")});
    EXPECT_EQ(said.exitCode, 0) << said.err;
    const json result = json::parse(readTextFile(at("eval.json")));
    EXPECT_GT(result.at("psnr").get<double>(), 8);
    EXPECT_EQ(result.at("views").size(), 2u);
    EXPECT_TRUE(fs::exists(fs::path(what) / "report.html"));
  }
  // Two blocks, and a level that holds both.
  const Said coarse = run({"eval", scene(), at("city"), "--lod", "1", "--json", at("eval.json")});
  EXPECT_EQ(coarse.exitCode, 0) << coarse.err;
  EXPECT_GT(json::parse(readTextFile(at("eval.json"))).at("psnr").get<double>(), 8);
  const Said none = run({"eval", scene(), at("city"), "--lod", "2"});
  EXPECT_EQ(none.exitCode, 1);
  EXPECT_TRUE(contains(none.err, "levels 0 to 1")) << none.err;
  const Said drawn = run({"render", scene(), at("pictures"), "--views", at("city"), "--size", "32x24"});
  EXPECT_EQ(drawn.exitCode, 0) << drawn.err;
  EXPECT_TRUE(fs::exists(fs::path(at("pictures")) / "images/photo_0000.png"));
  const Said info = run({"info", model(), "--json"});
  EXPECT_EQ(info.exitCode, 0) << info.err;
  const json said = json::parse(info.out);
  EXPECT_EQ(said.at("method"), "volume");
  EXPECT_EQ(said.at("blocks").at("columns"), 2);
  EXPECT_EQ(said.at("config").at("voxels"), "16");
  const Said ofScene = run({"info", scene(), "--json"});
  EXPECT_EQ(ofScene.exitCode, 0) << ofScene.err;
  const json holds = json::parse(ofScene.out);
  EXPECT_EQ(holds.at("kind"), "scene");
  EXPECT_EQ(holds.at("level_0").at("contents"), 2);
  EXPECT_EQ(holds.at("level_1").at("contents"), 1);
  EXPECT_EQ(holds.at("surround").at("contents"), 1);
  uintmax_t onDisk = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(scene())) {
    if (entry.path().extension() == ".glb") onDisk += entry.file_size();
  }
  const auto sum = [&](const char* what) {
    int64_t bytes = 0;
    for (const char* part : {"level_0", "level_1", "surround"}) bytes += holds.at(part).at(what).get<int64_t>();
    return bytes;
  };
  EXPECT_EQ(sum("bytes_on_disk"), static_cast<int64_t>(onDisk));
  EXPECT_GT(sum("bytes_in_memory"), static_cast<int64_t>(onDisk));
}

TEST_F(VolumeCommandLine, EndsWithTheSameBytesHoweverOftenItIsKilled) {
  const std::string unbroken = at("unbroken"), killed = at("killed");
  ASSERT_EQ(run(trainArguments(unbroken, {"--steps", "60"})).exitCode, 0);
  for (int times = 0; times < 3; ++times) {
    Program program(folder_, trainArguments(killed, {"--steps", "60", "--resume", "--checkpoint-seconds", "0"}));
    waitForFile(program, fs::path(killed) / "manifest.json");
    program.kill(SIGKILL);
    program.wait();
  }
  const Said last = run(trainArguments(killed, {"--steps", "60", "--resume"}));
  ASSERT_EQ(last.exitCode, 0) << last.err;
  EXPECT_EQ(checkpoints(killed), checkpoints(unbroken));
}

TEST_F(VolumeCommandLine, LeavesTheOldSceneWholeWhenBakingIsKilled) {
  const std::string rebaked = at("rebaked");
  ASSERT_EQ(run({"bake", model(), rebaked}).exitCode, 0);
  const std::string before = readTextFile(fs::path(rebaked) / "tileset.json");
  {
    Program program(folder_, {"bake", model(), rebaked});
    program.kill(SIGKILL);
    program.wait();
  }
  EXPECT_EQ(readTextFile(fs::path(rebaked) / "tileset.json"), before);
  EXPECT_EQ(run({"eval", rebaked, at("city")}).exitCode, 0);
}

TEST_F(VolumeCommandLine, RefusesBlocksThatAreNone) {
  for (const char* blocks : {"2", "0x2", "2x", "-1x2", "many", "99999x99999"}) {
    std::vector<std::string> arguments = {"train", at("city"), at("never"), "--method", "volume", "--blocks", blocks};
    const Said said = run(arguments);
    EXPECT_EQ(said.exitCode, 2) << blocks << said.err;
    EXPECT_TRUE(contains(said.err, "--blocks")) << said.err;
  }
  const std::string grid = (fs::path(model()) / "blocks.json").string();
  const Said both = run({"train", at("city"), at("never"), "--method", "volume", "--blocks", "2x2", "--grid", grid});
  EXPECT_EQ(both.exitCode, 2) << both.err;
  const Said ofField = run({"train", at("city"), at("never"), "--method", "field", "--grid", grid});
  EXPECT_EQ(ofField.exitCode, 2) << ofField.err;
  EXPECT_TRUE(contains(ofField.err, "--grid")) << ofField.err;
  const Said none = run({"train", at("city"), at("never"), "--method", "volume", "--grid", at("city/transforms.json")});
  EXPECT_EQ(none.exitCode, 1) << none.err;
  EXPECT_TRUE(contains(none.err, "holds no grid of blocks")) << none.err;
  EXPECT_FALSE(fs::exists(at("never")));
}

TEST_F(VolumeCommandLine, TrainsTheBlocksOfAnotherModel) {
  std::vector<std::string> arguments = {
      "train",   at("city"), at("again"), "--method", "volume", "--grid", (fs::path(model()) / "blocks.json").string(),
      "--steps", "40"};
  for (const std::string& setting : kTiny) arguments.insert(arguments.end(), {"--set", setting});
  const Said said = run(arguments);
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_EQ(checkpoints(at("again")), checkpoints(model()));
}

TEST_F(VolumeCommandLine, ExplainsWhatIsWrongWithModelsAndScenes) {
  const auto explained = [](const Said& said, const std::string& part) {
    EXPECT_EQ(said.exitCode, 1) << said.err;
    EXPECT_TRUE(contains(said.err, "tessera: error: ")) << said.err;
    EXPECT_TRUE(contains(said.err, part)) << said.err;
  };
  explained(run({"bake", at("city"), at("never")}), "no trained model");
  explained(run({"bake", model(), at("never"), "--capture", at("nowhere")}), "nowhere");
  explained(run(trainArguments(at("never"), {"--set", "surround=all"})), "surround");
  explained(run(trainArguments(at("never"), {"--set", "preset=gpu"})), "preset");
  const fs::path broken = at("broken");
  fs::copy(scene(), broken, fs::copy_options::recursive);
  fs::path tile;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(broken)) {
    if (entry.path().extension() == ".glb") tile = entry.path();
  }
  fs::resize_file(tile, fs::file_size(tile) / 2);
  explained(run({"eval", broken.string(), at("city")}), tile.filename().string());
  fs::remove(tile);
  explained(run({"eval", broken.string(), at("city")}), tile.filename().string());
  writeFileAtomically(broken / "tileset.json", std::string_view("{}"));
  explained(run({"render", broken.string(), at("never"), "--views", at("city")}), "tileset.json");
}

}  // namespace
}  // namespace tessera
