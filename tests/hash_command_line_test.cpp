// Runs the program as a user does, with `--method hash`.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/program.h"

namespace tessera {
namespace {

using nlohmann::json;

// Settings that train a model in a moment.
const std::vector<std::string> kTinyHash = {"lattice=16",
                                            "coarse_levels=3",
                                            "coarse_log2_size=10",
                                            "width=16",
                                            "fine_levels=2",
                                            "fine_log2_size=10",
                                            "direction_width=16",
                                            "occupancy_resolution=16",
                                            "samples_per_step=4096",
                                            "first_rays=64",
                                            "max_rays=512"};

class HashCommandLine : public testing::Test {
 protected:
  // All tests share one city.
  static void SetUpTestSuite() {
    folder_ = fs::weakly_canonical(fs::temp_directory_path()) / ("tessera-hash-line-" + std::to_string(::getpid()));
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
    std::vector<std::string> arguments = {"train", at("city"), model, "--method", "hash", "--blocks", "2x1"};
    for (const std::string& setting : kTinyHash) arguments.insert(arguments.end(), {"--set", setting});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  static std::vector<Bytes> checkpoints(const std::string& model) {
    const json manifest = json::parse(readTextFile(fs::path(model) / "manifest.json"));
    std::vector<Bytes> files;
    for (const json& file : manifest.at("files")) files.push_back(readFile(fs::path(model) / file.get<std::string>()));
    return files;
  }
  static inline fs::path folder_;
};

TEST_F(HashCommandLine, TrainsEvaluatesAndRendersASyntheticCity) {
  const std::string model = at("model");
  const Said trained = run(trainArguments(model, {"--steps", "40"}));
  ASSERT_EQ(trained.exitCode, 0) << trained.err;
  for (const char* file : {"blocks.svg", "blocks.geojson", "blocks.json", "config.toml"}) {
    EXPECT_TRUE(fs::exists(fs::path(model) / file)) << file;
  }
  EXPECT_EQ(checkpoints(model).size(), 3u) << "two blocks and the background block";
  const Said judged = run({"eval", model, at("city"), "--json", at("numbers.json")});
  ASSERT_EQ(judged.exitCode, 0) << judged.err;
  EXPECT_GT(json::parse(readTextFile(at("numbers.json"))).at("psnr").get<double>(), 10);
  const Said drawn = run({"render", model, at("pictures"), "--views", at("city"), "--size", "24x18"});
  EXPECT_EQ(drawn.exitCode, 0) << drawn.err;
  const Said told = run({"info", model, "--json"});
  ASSERT_EQ(told.exitCode, 0) << told.err;
  const json info = json::parse(told.out);
  EXPECT_EQ(info.at("method"), "hash");
  EXPECT_EQ(info.at("blocks").at("columns"), 2);
  EXPECT_EQ(info.at("multiply_accumulates_per_sample"), 8 * 12 + 2 * 8 * 8 + 2 * 8);
  EXPECT_EQ(info.at("view_dependent_multiply_accumulates_per_ray"), 16 * 23 + 16 * 16 + 16 * 3);
  const Said baked = run({"bake", model, at("scene")});
  ASSERT_EQ(baked.exitCode, 0) << baked.err;
  const Said scene = run({"info", at("scene"), "--json"});
  ASSERT_EQ(scene.exitCode, 0) << scene.err;
  EXPECT_EQ(json::parse(scene.out).at("representation"), "hash");
  EXPECT_EQ(json::parse(scene.out).at("level_0").at("contents"), 2);
  EXPECT_EQ(json::parse(scene.out).at("background_block_0").at("contents"), 1);
  EXPECT_EQ(json::parse(scene.out).at("level_1").at("contents"), 1) << "both blocks, coarser";
  const Said judgedScene = run({"eval", at("scene"), at("city"), "--json", at("scene.json")});
  ASSERT_EQ(judgedScene.exitCode, 0) << judgedScene.err;
  EXPECT_NEAR(json::parse(readTextFile(at("scene.json"))).at("psnr").get<double>(),
              json::parse(readTextFile(at("numbers.json"))).at("psnr").get<double>(), 1);
  const Said drawnScene = run({"render", at("scene"), at("more"), "--views", at("city"), "--size", "24x18"});
  EXPECT_EQ(drawnScene.exitCode, 0) << drawnScene.err;
  const Said measured = run({"bench", "render", at("scene"), "--views", at("city"), "--json", "-"});
  ASSERT_EQ(measured.exitCode, 0) << measured.err;
  const json skipping = json::parse(measured.out).at("skipping");
  EXPECT_EQ(skipping.at("skipping").at("samples"), skipping.at("whole").at("samples"));
  EXPECT_EQ(skipping.at("by_cells").at("samples"), skipping.at("whole").at("samples"));
  EXPECT_EQ(skipping.at("largest_difference"), 0);
  ASSERT_EQ(run({"train", at("city"), at("beside"), "--method", "field", "--steps", "2"}).exitCode, 0);
  const Said compared = run({"bench", "render", at("scene"), "--views", at("city"), "--against", at("beside"),
                             "--threads", "2", "--json", "-"});
  ASSERT_EQ(compared.exitCode, 0) << compared.err;
  const json against = json::parse(compared.out).at("against");
  for (const char* each : {"scene", "field", "field_culled"}) {
    EXPECT_GT(against.at(each).at("frames_per_second"), 0) << each;
    EXPECT_GE(against.at(each).at("densities_per_ray"), against.at(each).at("samples_per_ray")) << each;
  }
  EXPECT_LE(against.at("field_culled").at("densities_per_ray"), against.at("field").at("densities_per_ray"));
  const Said odd = run({"bake", model, at("odd"), "--cells", "12"});
  EXPECT_EQ(odd.exitCode, 2);
  EXPECT_NE(odd.err.find("multiple of 8"), std::string::npos) << odd.err;
  EXPECT_FALSE(fs::exists(at("odd")));
}

TEST_F(HashCommandLine, ResumesAnExistingModel) {
  const std::string model = at("goes-on");
  ASSERT_EQ(run(trainArguments(model, {"--steps", "12"})).exitCode, 0);
  const auto step = [&] { return json::parse(readTextFile(fs::path(model) / "manifest.json")).at("step"); };
  EXPECT_EQ(step(), 12);
  const Said resumed = run({"train", at("city"), model, "--method", "hash", "--steps", "30", "--resume"});
  ASSERT_EQ(resumed.exitCode, 0) << resumed.err;
  EXPECT_EQ(step(), 30);
  const Said other =
      run({"train", at("city"), model, "--method", "hash", "--blocks", "1x1", "--steps", "40", "--resume"});
  EXPECT_EQ(other.exitCode, 1);
  EXPECT_NE(other.err.find("2x1"), std::string::npos) << other.err;
  EXPECT_EQ(step(), 30);
  const Said method = run({"train", at("city"), model, "--method", "field", "--steps", "40", "--resume"});
  EXPECT_EQ(method.exitCode, 1);
  EXPECT_NE(method.err.find("resume with --method hash"), std::string::npos) << method.err;
  const Said same = run({"train", at("city"), model, "--steps", "34", "--resume"});
  EXPECT_EQ(same.exitCode, 0) << "with the method of the folder: " << same.err;
  EXPECT_EQ(step(), 34);
}

TEST_F(HashCommandLine, RejectsOptionsThatItDoesNotSupport) {
  const Said resident = run(trainArguments(at("nothing"), {"--steps", "3", "--resident-blocks", "1"}));
  EXPECT_NE(resident.exitCode, 0);
  EXPECT_NE(resident.err.find("--resident-blocks"), std::string::npos) << resident.err;
  const Said wrong = run(trainArguments(at("nothing"), {"--steps", "3", "--set", "aggregation=vote"}));
  EXPECT_EQ(wrong.exitCode, 1);
  EXPECT_NE(wrong.err.find("attention, sum, mlp"), std::string::npos) << wrong.err;
  EXPECT_FALSE(fs::exists(at("nothing") + "/manifest.json"));
}

}  // namespace
}  // namespace tessera
