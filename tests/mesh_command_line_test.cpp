// Runs the program as a user does, with `--method mesh`.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/program.h"

namespace tessera {
namespace {

using nlohmann::json;

// Settings that train a model in a moment.
const std::vector<std::string> kTinyMesh = {"coarse_steps=150",
                                            "grid_levels=6",
                                            "grid_log2_size=12",
                                            "grid_base=8",
                                            "grid_finest=64",
                                            "width=16",
                                            "mesh_cells=32",
                                            "background_cells=16",
                                            "max_rays=512",
                                            "mesh_levels=2",
                                            "occupancy_start_steps=16",
                                            "occupancy_every=4",
                                            "vertex_start_steps=10",
                                            "first_rays=64",
                                            "opacity_offset=-1",
                                            "samples_per_step=4096",
                                            "learning_rate=0.02",
                                            "patch_texels=8"};

class MeshCommandLine : public testing::Test {
 protected:
  // All tests share one city.
  static void SetUpTestSuite() {
    folder_ = fs::weakly_canonical(fs::temp_directory_path()) / ("tessera-mesh-line-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const Said said = run({"synth", "city", at("city"), "--blocks", "1x1", "--photos", "12", "--size", "64x48",
                           "--samples", "1", "--seed", "3"});
    ASSERT_EQ(said.exitCode, 0) << said.err;
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static Said run(const std::vector<std::string>& arguments) { return Program(folder_, arguments).wait(); }
  static std::string at(const std::string& name) { return (folder_ / name).string(); }
  static Said train(const std::string& model, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"train", at("city"), at(model), "--method", "mesh", "--blocks", "2x1"};
    for (const std::string& setting : kTinyMesh) arguments.insert(arguments.end(), {"--set", setting});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  // Returns what `verb --json` says.
  static json told(const std::vector<std::string>& arguments) {
    const Said said = run(arguments);
    EXPECT_EQ(said.exitCode, 0) << said.err;
    return said.exitCode == 0 ? json::parse(said.out) : json();
  }
  static double psnr(const std::string& modelOrScene, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"eval", at(modelOrScene), at("city"), "--json", at("numbers.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Said said = run(arguments);
    EXPECT_EQ(said.exitCode, 0) << said.err;
    return said.exitCode == 0 ? json::parse(readTextFile(at("numbers.json"))).at("psnr").get<double>() : 0;
  }
  static inline fs::path folder_;
};

TEST_F(MeshCommandLine, TrainsPartsApartBakesAndRendersASyntheticCity) {
  const Said coarse = train("model", {"--steps", "120", "--only-blocks", "coarse"});
  ASSERT_EQ(coarse.exitCode, 0) << coarse.err;
  EXPECT_FALSE(fs::exists(folder_ / "model/parts/block_0_0/manifest.json"));
  for (const char* parts : {"block_1_0", "background, block_0_0"}) {
    const Said trained = train("model", {"--steps", "120", "--resume", "--only-blocks", parts});
    ASSERT_EQ(trained.exitCode, 0) << trained.err;
    const Said evaluated = run({"eval", at("model"), at("city"), "--json", "-"});
    EXPECT_EQ(contains(evaluated.err, "background has not been trained"), std::string(parts) == "block_1_0")
        << evaluated.err;
  }
  const json model = told({"info", at("model"), "--json"});
  EXPECT_EQ(model.at("method"), "mesh");
  EXPECT_EQ(model.at("blocks").at("columns"), 2);
  EXPECT_EQ(model.at("vertices_per_block"), 32 * 32 * 32);
  for (const char* block : {"block_0_0", "block_1_0"}) EXPECT_GT(model.at("coverage").at(block).at("pixels"), 0);
  EXPECT_GT(psnr("model"), 10);

  const json baked = told({"bake", at("model"), at("scene"), "--json"});
  EXPECT_GT(baked.at("levels").at(0).at("fallback_bytes"), 0);
  const json scene = told({"info", at("scene"), "--json"});
  EXPECT_EQ(scene.at("representation"), "mesh");
  EXPECT_EQ(scene.at("blocks").at("columns"), 2) << "a tile for each 32 cells";
  for (const char* level : {"background_block_0", "background_block_1"}) EXPECT_EQ(scene.at(level).at("contents"), 1);
  EXPECT_EQ(scene.at("level_1").at("contents"), 1) << "both blocks, coarser";
  EXPECT_EQ(scene.at("coverage"), model.at("coverage"));
  const double finest = psnr("scene");
  EXPECT_GT(finest, 10);
  EXPECT_NE(psnr("scene", {"--lod", "1"}), finest);
  const Said drawn = run({"render", at("scene"), at("pictures"), "--views", at("city"), "--size", "24x18"});
  EXPECT_EQ(drawn.exitCode, 0) << drawn.err;

  const json exported = told({"export", at("scene"), at("scene.glb"), "--format", "gltf", "--level", "1", "--json"});
  EXPECT_EQ(exported.at("bytes_on_disk"), fs::file_size(folder_ / "scene.glb"));
  EXPECT_GT(exported.at("triangles"), 0);
  const json& triangles = baked.at("levels").at(0).at("triangles");
  EXPECT_EQ(told({"export", at("scene"), at("tiles"), "--format", "gltf", "--split", "--json"}).at("triangles"),
            triangles);
  const json forUnreal = told({"export", at("scene"), at("unreal"), "--format", "unreal", "--json"});
  EXPECT_EQ(forUnreal.at("triangles"), triangles);
  EXPECT_EQ(forUnreal.at("decoders"), forUnreal.at("parts")) << "each block has a decoder of its own";
  const Said unopened = run({"export", at("scene"), at("viewed"), "--format", "mobilenerf", "--level", "1"});
  EXPECT_EQ(unopened.exitCode, 1);
  EXPECT_TRUE(contains(unopened.err, "_phone")) << unopened.err;
  const Said split = run({"export", at("scene"), at("unreal"), "--format", "unreal", "--split"});
  EXPECT_EQ(split.exitCode, 1);
  EXPECT_TRUE(contains(split.err, "has no meaning for the format unreal")) << split.err;

  told({"bake", at("model"), at("small"), "--json", "--maps", "inferred", "--fallback", "0"});
  const json small = told({"info", at("small"), "--json"});
  EXPECT_GE(small.at("shared_resources").at("files"), 1) << "encoders of blocks";
  EXPECT_EQ(psnr("small"), finest) << "the same textures";
  const Said unexported = run({"export", at("small"), at("small.glb"), "--format", "gltf"});
  EXPECT_EQ(unexported.exitCode, 1);
  EXPECT_TRUE(contains(unexported.err, "--fallback 1")) << unexported.err;
  told({"bake", at("model"), at("pieces"), "--json", "--tiles-per-block", "2", "--texels", "12"});
  const json pieces = told({"info", at("pieces"), "--json"});
  EXPECT_EQ(pieces.at("blocks").at("columns"), 4);
  EXPECT_GT(pieces.at("level_0").at("bytes_in_memory"), scene.at("level_0").at("bytes_in_memory"));
}

TEST_F(MeshCommandLine, BakesModelsWithoutAFinalStage) {
  const Said trained = train("plain", {"--steps", "120", "--set", "final_share=0"});
  ASSERT_EQ(trained.exitCode, 0) << trained.err;
  EXPECT_FALSE(told({"info", at("plain"), "--json"}).contains("coverage"))
      << "its triangles are chosen when it is baked";
  told({"bake", at("plain"), at("plain.scene"), "--json", "--maps", "inferred"});
  const json scene = told({"info", at("plain.scene"), "--json"});
  EXPECT_EQ(scene.at("level_1").at("contents"), 1);
  EXPECT_GT(psnr("plain.scene"), 10);
  EXPECT_GT(psnr("plain.scene", {"--lod", "1"}), 8);
}

TEST_F(MeshCommandLine, RejectsOptionsThatItDoesNotSupport) {
  const auto refuses = [](const Said& said, const std::string& part) {
    EXPECT_NE(said.exitCode, 0);
    EXPECT_TRUE(contains(said.err, part)) << said.err;
  };
  refuses(train("nothing", {"--steps", "3", "--resident-blocks", "1"}), "--resident-blocks");
  refuses(train("nothing", {"--steps", "3", "--only-blocks", "block_7_7"}), "block_7_7");
  refuses(train("nothing", {"--steps", "3", "--set", "patch_texels=10"}), "patch_texels");
  refuses(train("nothing", {"--steps", "3", "--set", "background_block=learned"}), "background_block");
  EXPECT_FALSE(fs::exists(folder_ / "nothing/manifest.json"));
  ASSERT_EQ(train("few", {"--steps", "4", "--only-blocks", "coarse"}).exitCode, 0);
  refuses(run({"bake", at("few"), at("no.scene")}), "none has been trained yet");
  refuses(run({"bake", at("few"), at("no.scene"), "--texels", "4"}), "--texels 4");
  refuses(run({"bake", at("few"), at("no.scene"), "--tiles-per-block", "3"}), "--tiles-per-block 3");
  refuses(run({"bake", at("few"), at("no.scene"), "--maps", "guessed"}), "stored");
  EXPECT_FALSE(fs::exists(at("no.scene")));
  refuses(run({"bake", at("few"), at("few")}), "holds a model");
  refuses(run({"bake", at("few"), at("city")}), "holds a capture");
  refuses(run({"eval", at("few"), at("city"), "--lod", "1"}), "--lod: applies to scenes");
  refuses(run({"eval", at("absent"), at("city"), "--lod", "1"}), "this is not a trained model");
  refuses(run({"render", at("few"), at("pictures"), "--views", at("city"), "--memory-mib", "9"}), "--memory-mib");
}

TEST_F(MeshCommandLine, ResumesWithTheMethodOfTheFolder) {
  const std::vector<std::string> coarse = {"train", at("city"), at("same"), "--resume", "--only-blocks", "coarse"};
  ASSERT_EQ(train("same", {"--steps", "8", "--only-blocks", "coarse"}).exitCode, 0);
  const Said said = run(coarse);
  EXPECT_EQ(said.exitCode, 0) << said.err;
  std::vector<std::string> other = coarse;
  other.insert(other.end(), {"--method", "volume"});
  const Said refused = run(other);
  EXPECT_NE(refused.exitCode, 0);
  EXPECT_TRUE(contains(refused.err, "mesh")) << refused.err;
  writeFileAtomically(at("scene.folder/tileset.json"), "{}");
  EXPECT_TRUE(contains(train("scene.folder", {"--steps", "8"}).err, "holds a scene"));
}

}  // namespace
}  // namespace tessera
