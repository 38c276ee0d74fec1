// Runs the program as a user does on large places: blocks, tiles, and error messages about them.
#include <gtest/gtest.h>

#include <array>
#include <csignal>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/program.h"

namespace tessera {
namespace {

using nlohmann::json;

// Settings that train a model in a moment.
const std::vector<std::string> kTinyVolume = {
    "voxels=16",          "planes=32",         "grid_levels=4",        "grid_log2_size=10",  "grid_finest=32",
    "width=16",           "proposal_levels=3", "proposal_log2_size=8", "proposal_finest=16", "first_intervals=12",
    "second_intervals=8", "samples=8",         "texels_per_step=8192", "first_rays=64",      "max_rays=512",
    "sparsity_points=128"};

class VolumeCommandLine : public testing::Test {
 protected:
  // All tests share one city.
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
    for (const std::string& setting : kTinyVolume) arguments.insert(arguments.end(), {"--set", setting});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  // A model, and the scene baked from it, each made once.
  static std::string model() {
    const std::string modelPath = at("model");
    if (!fs::exists(modelPath)) {
      const Said said = run(trainArguments(modelPath, {"--steps", "40"}));
      EXPECT_EQ(said.exitCode, 0) << said.err;
    }
    return modelPath;
  }
  static std::string scene() {
    const std::string scenePath = at("scene");
    if (!fs::exists(scenePath)) {
      const Said said = run({"bake", model(), scenePath});
      EXPECT_EQ(said.exitCode, 0) << said.err;
      EXPECT_TRUE(contains(said.out, "macroblocks")) << said.out;
    }
    return scenePath;
  }
  static std::vector<Bytes> checkpoints(const std::string& model) {
    const json manifest = json::parse(readTextFile(fs::path(model) / "manifest.json"));
    std::vector<Bytes> files;
    for (const json& file : manifest.at("files")) files.push_back(readFile(fs::path(model) / file.get<std::string>()));
    return files;
  }
  static inline fs::path folder_;
};

// Exposures that EXIF states explain the gains that were trained, and model and scene know how.
TEST_F(VolumeCommandLine, PredictsExposuresWhereExifExplainsThem) {
  const Said synthesised = run({"synth", "city", at("jittered"), "--blocks", "1x1", "--photos", "16", "--size", "48x36",
                                "--samples", "1", "--seed", "3", "--exposure-jitter", "1"});
  ASSERT_EQ(synthesised.exitCode, 0) << synthesised.err;
  // The exposures are forgotten, and read from EXIF.
  const fs::path transforms = fs::path(at("jittered")) / "transforms.json";
  json capture = json::parse(readTextFile(transforms));
  std::map<std::string, double> exposures;
  for (json& frame : capture["frames"]) {
    exposures[fs::path(frame["file_path"].get<std::string>()).stem()] = frame["tessera"]["exposure"].get<double>();
    frame["tessera"].erase("exposure");
  }
  writeFileAtomically(transforms, capture.dump());
  const Said imported = run({"import", at("jittered"), at("by-exif")});
  ASSERT_EQ(imported.exitCode, 0) << imported.err;
  const json byExif = json::parse(readTextFile(fs::path(at("by-exif")) / "transforms.json"));
  ASSERT_EQ(byExif["frames"].size(), exposures.size());
  for (const json& frame : byExif["frames"]) {
    const std::string name = fs::path(frame["file_path"].get<std::string>()).stem();
    EXPECT_NEAR(frame["tessera"]["exposure"].get<double>(), exposures.at(name), 0.01) << name;
  }
  std::vector<std::string> arguments = trainArguments(at("exposed"), {"--steps", "200"});
  arguments[1] = at("by-exif");
  ASSERT_EQ(run(arguments).exitCode, 0);
  ASSERT_EQ(run({"bake", at("exposed"), at("exposed.scene")}).exitCode, 0);
  for (const std::string& what : {at("exposed"), at("exposed.scene")}) {
    const Said said = run({"eval", what, at("by-exif"), "--exposure", "predicted"});
    EXPECT_EQ(said.exitCode, 0) << said.err;
    EXPECT_TRUE(contains(said.out + said.err, "exposure predicted from EXIF")) << said.out << said.err;
    const Said chosen = run({"eval", what, at("by-exif"), "--exposure", "auto"});
    EXPECT_TRUE(contains(chosen.out, "exposure predicted from EXIF")) << chosen.out << chosen.err;
  }
  for (const std::string& what : {model(), scene()}) {
    const Said said = run({"eval", what, at("city"), "--exposure", "predicted"});
    EXPECT_EQ(said.exitCode, 1) << "all photos of this city have one exposure";
    EXPECT_TRUE(contains(said.err, "EXIF")) << said.err;
    const Said chosen = run({"eval", what, at("city"), "--exposure", "auto"});
    EXPECT_TRUE(contains(chosen.out, "exposure neutral")) << chosen.out << chosen.err;
  }
}

TEST_F(VolumeCommandLine, GoesTheWholeWayFromACityToThePicturesOfAScene) {
  for (const char* file : {"blocks.svg", "blocks.geojson", "blocks.json", "config.toml"}) {
    EXPECT_TRUE(fs::exists(fs::path(model()) / file)) << file;
  }
  EXPECT_EQ(checkpoints(model()).size(), 3u) << "two blocks and the background block";
  for (const std::string& what : {model(), scene()}) {
    const Said said = run({"eval", what, at("city"), "--json", at("eval.json")});
    EXPECT_EQ(said.exitCode, 0) << said.err;
    const json result = json::parse(readTextFile(at("eval.json")));
    EXPECT_GT(result.at("psnr").get<double>(), 8);
    EXPECT_EQ(result.at("views").size(), 2u);
    EXPECT_TRUE(fs::exists(fs::path(what) / "report.html"));
  }
  // Two blocks, and a level that merges both.
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
  for (const char* backgroundBlock : {"background_block_0", "background_block_1"})
    EXPECT_EQ(holds.at(backgroundBlock).at("contents"), 1);
  uintmax_t onDisk = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(scene())) {
    if (entry.path().extension() == ".glb") onDisk += entry.file_size();
  }
  const auto sum = [&](const char* what) {
    int64_t bytes = 0;
    for (const char* part : {"level_0", "level_1", "background_block_0", "background_block_1"}) {
      bytes += holds.at(part).at(what).get<int64_t>();
    }
    return bytes;
  };
  EXPECT_EQ(sum("bytes_on_disk"), static_cast<int64_t>(onDisk));
  EXPECT_GT(sum("bytes_in_memory"), static_cast<int64_t>(onDisk));
}

TEST_F(VolumeCommandLine, RejectsALevelThatOnlyGroupsOthers) {
  const Said trained = run(trainArguments(at("flat"), {"--steps", "10", "--set", "lod_step_fraction=0"}));
  ASSERT_EQ(trained.exitCode, 0) << trained.err;
  ASSERT_EQ(run({"bake", at("flat"), at("flat.scene")}).exitCode, 0);
  const json tileset = json::parse(readTextFile(fs::path(at("flat.scene")) / "tileset.json"));
  EXPECT_EQ(tileset.at("extensions").at("TESSERA_scene").at("levels"), 2);  // the root is a level
  const Said said = run({"eval", at("flat.scene"), at("city"), "--lod", "1"});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "flat.scene")) << said.err;
  EXPECT_TRUE(contains(said.err, "has level 0 only")) << said.err;
  EXPECT_EQ(run({"eval", at("flat.scene"), at("city"), "--lod", "0"}).exitCode, 0);
}

TEST_F(VolumeCommandLine, MeasuresWhatSkippingSavesAndAFlightWithASmallCache) {
  const Said said = run({"bench", "render", scene(), "--views", at("city"), "--flight", "--steps", "20", "--share", "4",
                         "--json", at("bench.json")});
  EXPECT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.out, "times fewer steps")) << said.out;
  const json result = json::parse(readTextFile(at("bench.json")));
  const json &skipping = result.at("skipping"), &cache = result.at("cache");
  EXPECT_EQ(skipping.at("rays"), 2 * 48 * 36);
  EXPECT_GT(skipping.at("skipping").at("samples"), 0);
  EXPECT_EQ(skipping.at("skipping").at("samples"), skipping.at("whole").at("samples"));
  EXPECT_LE(skipping.at("skipping").at("steps"), skipping.at("whole").at("steps"));
  EXPECT_EQ(skipping.at("largest_difference"), 0);
  EXPECT_EQ(cache.at("steps"), 20);
  EXPECT_EQ(cache.at("all").at("budget_bytes"), cache.at("all_bytes"));
  EXPECT_EQ(cache.at("all").at("steps_in_full"), 20);
  EXPECT_EQ(cache.at("all").at("steps_unlike_unbounded"), 0);
  // A budget slightly below the whole scene, and one below the coarsest level.
  const double mebibytes = cache.at("all_bytes").get<double>() / 1048576;
  const Said coarser = run({"eval", scene(), at("city"), "--memory-mib", std::to_string(0.99 * mebibytes)});
  EXPECT_EQ(coarser.exitCode, 0) << coarser.err;
  EXPECT_TRUE(contains(coarser.err, "--memory-mib")) << coarser.err;
  EXPECT_FALSE(contains(run({"eval", scene(), at("city")}).err, "--memory-mib"));
  const Said none = run({"eval", scene(), at("city"), "--memory-mib", std::to_string(0.01 * mebibytes)});
  EXPECT_EQ(none.exitCode, 1);
  EXPECT_TRUE(contains(none.err, "allow at least")) << none.err;
  const Said tooSmall = run({"bench", "render", scene(), "--flight", "--share", "0.01"});
  EXPECT_EQ(tooSmall.exitCode, 1);
  EXPECT_TRUE(contains(tooSmall.err, "coarsest level")) << tooSmall.err;
  EXPECT_EQ(run({"bench", "render", scene()}).exitCode, 2);
}

TEST_F(VolumeCommandLine, EndsWithTheSameBytesHoweverOftenItIsKilled) {
  const std::string unbroken = at("unbroken"), killed = at("killed");
  ASSERT_EQ(run(trainArguments(unbroken, {"--steps", "60"})).exitCode, 0);
  for (int times = 0; times < 3; ++times) {
    const int64_t before = readLastStep(killed);
    Program program(folder_, trainArguments(killed, {"--steps", "60", "--resume", "--checkpoint-seconds", "0"}));
    waitUntil(program, [&] { return readLastStep(killed) > before + 2; });
    program.kill(SIGKILL);
    program.wait();
  }
  const Said last = run(trainArguments(killed, {"--steps", "60", "--resume"}));
  ASSERT_EQ(last.exitCode, 0) << last.err;
  EXPECT_EQ(checkpoints(killed), checkpoints(unbroken));
}

TEST_F(VolumeCommandLine, TrainsWithFewBlocksInMemoryAndSaysHowMuchThatTakes) {
  const std::string few = at("few");
  const Said said = run(trainArguments(few, {"--steps", "20", "--resident-blocks", "1", "--set", "residency_steps=8"}));
  EXPECT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.err, "memory: at most")) << said.err;
  EXPECT_FALSE(fs::exists(fs::path(few) / "waiting"));
  EXPECT_EQ(run({"eval", few, at("city")}).exitCode, 0);
  const Said field = run({"train", at("city"), at("field"), "--method", "field", "--resident-blocks", "1"});
  EXPECT_NE(field.exitCode, 0);
  EXPECT_TRUE(contains(field.err, "resident_blocks")) << field.err;
}

TEST_F(VolumeCommandLine, BakesWithFewBlocksInMemory) {
  const Said said = run({"bake", model(), at("sparing"), "--resident-blocks", "1", "--json"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.err, "raise --resident-blocks")) << said.err;
  EXPECT_EQ(json::parse(said.out).at("tiles"), 3);
  // With as many resident blocks as there are, the scene is the same.
  ASSERT_EQ(run({"bake", model(), at("whole"), "--resident-blocks", "2"}).exitCode, 0);
  const auto tileset = [](const std::string& of) { return readTextFile(fs::path(of) / "tileset.json"); };
  EXPECT_EQ(tileset(at("whole")), tileset(scene()));
  const auto psnr = [&](const std::string& of) {
    EXPECT_EQ(run({"eval", of, at("city"), "--json", at("eval.json")}).exitCode, 0);
    return json::parse(readTextFile(at("eval.json"))).at("psnr").get<double>();
  };
  EXPECT_NEAR(psnr(at("sparing")), psnr(scene()), 0.2);
  EXPECT_EQ(run({"bake", model(), at("never"), "--resident-blocks", "-1"}).exitCode, 2);
}

TEST_F(VolumeCommandLine, BakesAHazySkyOrTheBackgroundThatIsAskedFor) {
  const auto background = [](const std::string& scene) {
    const json tileset = json::parse(readTextFile(fs::path(scene) / "tileset.json"));
    return tileset.at("extensions").at("TESSERA_scene").at("background").get<std::array<float, 3>>();
  };
  EXPECT_EQ(background(scene()), (std::array<float, 3>{0.74f, 0.8f, 0.86f}));
  const Said said = run({"bake", model(), at("dusk"), "--stride", "16", "--background", "0.1", "0.25", "0.5"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  EXPECT_EQ(background(at("dusk")), (std::array<float, 3>{0.1f, 0.25f, 0.5f}));
  for (const char* wrong : {"1.5", "-1", "x"}) {
    EXPECT_EQ(run({"bake", model(), at("never"), "--background", "0", "0", wrong}).exitCode, 2) << wrong;
  }
}

TEST_F(VolumeCommandLine, LeavesTheOldSceneWholeWhenBakingIsKilled) {
  const std::string rebaked = at("rebaked"), other = at("other");
  // Another model that takes longer to bake, so that there is time to kill the process.
  ASSERT_EQ(run(trainArguments(other, {"--steps", "30", "--set", "planes=512", "--set", "voxels=64"})).exitCode, 0);
  ASSERT_EQ(run({"bake", model(), rebaked}).exitCode, 0);
  const auto tiles = [&] {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(fs::path(rebaked) / "tiles")) {
      if (entry.path().extension() == ".glb") files.push_back(entry.path());
    }
    return files;
  };
  std::map<fs::path, Bytes> old;
  for (const fs::path& file : tiles()) old[file] = readFile(file);
  const std::string before = readTextFile(fs::path(rebaked) / "tileset.json");
  {
    Program program(folder_, {"bake", other, rebaked});
    while (tiles().size() == old.size() && !program.ended()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    program.kill(SIGKILL);
    ASSERT_EQ(program.wait().exitCode, 128 + SIGKILL) << "it was done before";
  }
  EXPECT_EQ(readTextFile(fs::path(rebaked) / "tileset.json"), before);
  EXPECT_GT(tiles().size(), old.size()) << "with what was baked of the other";
  for (const auto& [file, bytes] : old) EXPECT_EQ(readFile(file), bytes) << file;
  EXPECT_EQ(run({"eval", rebaked, at("city")}).exitCode, 0);
  ASSERT_EQ(run({"bake", other, rebaked}).exitCode, 0);
  EXPECT_NE(readTextFile(fs::path(rebaked) / "tileset.json"), before);
  for (const auto& [file, bytes] : old) EXPECT_FALSE(fs::exists(file)) << "the old scene has gone";
}

TEST_F(VolumeCommandLine, TakesThePresetOfASettingsFile) {
  const fs::path file = folder_ / "settings.toml";
  writeFileAtomically(file, "preset = \"huge\"\n");
  const Said said = run({"train", at("city"), at("never"), "--method", "volume", "--config", file.string()});
  EXPECT_EQ(said.exitCode, 1);
  EXPECT_TRUE(contains(said.err, "preset=huge")) << said.err;
  writeFileAtomically(file, "preset = \"paper\"\n");
  EXPECT_EQ(run(trainArguments(at("paper"), {"--steps", "1", "--config", file.string()})).exitCode, 0);
  EXPECT_TRUE(contains(readTextFile(folder_ / "paper/config.toml"), "hidden = 3"));
}

TEST_F(VolumeCommandLine, PlansForTheMemoryThatItIsGiven) {
  const Said said = run(trainArguments(at("planned"), {"--steps", "2", "--memory-mib", "1"}));
  EXPECT_EQ(said.exitCode, 0) << said.err;
  EXPECT_TRUE(contains(said.err, "more than the 1 MiB available")) << said.err;
  EXPECT_FALSE(contains(run(trainArguments(at("planned"), {"--steps", "2", "--resume"})).err, "MiB available"));
}

TEST_F(VolumeCommandLine, RejectsInvalidBlocks) {
  for (const char* blocks : {"2", "0x2", "2x", "-1x2", "many", "5000x1", "99999x99999"}) {
    std::vector<std::string> arguments = {"train", at("city"), at("never"), "--method", "volume", "--blocks", blocks};
    const Said said = run(arguments);
    EXPECT_EQ(said.exitCode, 2) << blocks << said.err;
    EXPECT_TRUE(contains(said.err, "--blocks")) << said.err;
  }
  const std::string grid = (fs::path(model()) / "blocks.json").string();
  const Said both = run({"train", at("city"), at("never"), "--method", "volume", "--blocks", "2x2", "--grid", grid});
  EXPECT_EQ(both.exitCode, 2) << both.err;
  const Said cut = run({"train", at("city"), at("never"), "--method", "field", "--blocks", "2x2"});
  EXPECT_EQ(cut.exitCode, 2) << cut.err;
  EXPECT_TRUE(contains(cut.err, "--blocks: applies to --method ")) << cut.err;
  const Said ofField = run({"train", at("city"), at("never"), "--method", "field", "--grid", grid});
  EXPECT_EQ(ofField.exitCode, 2) << ofField.err;
  EXPECT_TRUE(contains(ofField.err, "--grid")) << ofField.err;
  const Said none = run({"train", at("city"), at("never"), "--method", "volume", "--grid", at("city/transforms.json")});
  EXPECT_EQ(none.exitCode, 1) << none.err;
  EXPECT_TRUE(contains(none.err, "holds no grid of blocks")) << none.err;
  EXPECT_FALSE(fs::exists(at("never")));
}

TEST_F(VolumeCommandLine, ExportsASceneOfOneBlockForMerfsViewer) {
  std::vector<std::string> arguments = {"train",
                                        at("city"),
                                        at("one"),
                                        "--method",
                                        "volume",
                                        "--blocks",
                                        "1x1",
                                        "--steps",
                                        "40",
                                        "--set",
                                        "background_block=border"};
  for (const std::string& setting : kTinyVolume) arguments.insert(arguments.end(), {"--set", setting});
  for (const char* setting : {"voxels=32", "planes=512"}) arguments.insert(arguments.end(), {"--set", setting});
  const Said trained = run(arguments);
  ASSERT_EQ(trained.exitCode, 0) << trained.err;
  ASSERT_EQ(run({"bake", at("one"), at("one.scene")}).exitCode, 0);
  const Said said = run({"export", at("one.scene"), at("one.merf"), "--format", "merf", "--json"});
  ASSERT_EQ(said.exitCode, 0) << said.err;
  const json result = json::parse(said.out);
  const fs::path folder = at("one.merf");
  EXPECT_EQ(result.at("format"), "merf");
  EXPECT_GT(result.at("macroblocks").get<int>(), 0);
  EXPECT_EQ(json::parse(readTextFile(folder / "scene_params.json")).at("num_slices"), result.at("slices"));
  for (const char* file : {"plane_features_2.png", "sparse_grid_features_008.png", "occupancy_grid_128.png"}) {
    EXPECT_TRUE(fs::exists(folder / file)) << file;
  }
  const Said again = run({"export", at("one.scene"), at("one.merf"), "--format", "merf"});
  EXPECT_EQ(again.exitCode, 0) << again.err;
  EXPECT_TRUE(contains(again.out, "near=0.05")) << again.out;

  EXPECT_EQ(run({"export", at("one.scene"), at("one.merf"), "--format", "vrml"}).exitCode, 2);
  EXPECT_EQ(run({"export", at("one.scene"), at("one.merf")}).exitCode, 2);
  const auto explained = [](const Said& refused, const std::string& part) {
    EXPECT_EQ(refused.exitCode, 1) << refused.err;
    EXPECT_TRUE(contains(refused.err, part)) << refused.err;
  };
  explained(run({"export", scene(), at("never"), "--format", "merf"}), "--blocks 1x1 --set background_block=border");
  explained(run({"export", at("one"), at("never"), "--format", "merf"}), "tessera bake");
  explained(run({"export", at("one.scene"), at("city"), "--format", "merf"}), "would be lost");
  EXPECT_FALSE(fs::exists(at("never")));
}

TEST_F(VolumeCommandLine, TrainsTheBlocksOfAnotherModel) {
  std::vector<std::string> arguments = {
      "train",   at("city"), at("again"), "--method", "volume", "--grid", (fs::path(model()) / "blocks.json").string(),
      "--steps", "40"};
  for (const std::string& setting : kTinyVolume) arguments.insert(arguments.end(), {"--set", setting});
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
  explained(run({"bake", at("city"), at("never")}), "not a trained model");
  explained(run({"bake", model(), at("never"), "--capture", at("nowhere")}), "nowhere");
  explained(run(trainArguments(at("never"), {"--set", "background_block=all"})), "background_block");
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

TEST_F(VolumeCommandLine, RendersAWorldByVulkanAndExplainsWhatIsWrongWithIt) {
  const fs::path file = folder_ / "worlds/world.json";
  const auto rendered = [&](const std::string& device, const std::string& url, const std::string& level = "0") {
    const json world = {{"kind", "tessera world"},
                        {"version", 2},
                        {"scenes", {{{"url", url}}, {{"url", url}, {"position", {30, 0, 0}}, {"visible", false}}}}};
    writeFileAtomically(file, std::string_view(world.dump()));
    const std::string out = at("world-" + device);
    return run(
        {"render", file.string(), out, "--views", at("city"), "--size", "32x24", "--device", device, "--lod", level});
  };
  scene();
  const Said onCpu = rendered("cpu", "../scene");
  EXPECT_EQ(onCpu.exitCode, 1);
  EXPECT_TRUE(contains(onCpu.err, "drawn by Vulkan only")) << onCpu.err;
  const Said lacking = rendered("cpu", "gone");
  EXPECT_EQ(lacking.exitCode, 1);
  EXPECT_TRUE(contains(lacking.err, "world.json: scenes[0].url: there is no scene in")) << lacking.err;
  const Said tooCoarse = rendered("cpu", "../scene", "2");
  EXPECT_EQ(tooCoarse.exitCode, 1);
  EXPECT_TRUE(
      contains(tooCoarse.err, "world.json: --lod 2: the coarsest level of its scenes is 1; name that or a finer one"))
      << tooCoarse.err;
  const Said drawn = rendered("vulkan", "../scene");
  if (contains(drawn.err, "no Vulkan")) GTEST_SKIP() << drawn.err;
  EXPECT_EQ(drawn.exitCode, 0) << drawn.err;
  EXPECT_TRUE(fs::exists(fs::path(at("world-vulkan")) / "images/photo_0000.png"));
}

}  // namespace
}  // namespace tessera
