#include "world/placed_models.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/temporary_folder.h"
#include "world/testing/test_models.h"

namespace tessera {
namespace {

WorldModel modelFrom(std::vector<std::string> files) {
  WorldModel model;
  model.name = "box";
  model.files = std::move(files);
  return model;
}

Bytes bytesFrom(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::array<float, 3> colour(const Model& model) {
  return model.materials[model.vertices[0].material].baseColour;
}

class PlacedModelsTest : public testing::Test {
 protected:
  fs::path worldFile() const { return folder_ / "world/world.json"; }
  void write(const std::string& path, const std::string& text) {
    writeFileAtomically(folder_ / "world" / path, std::string_view(text));
  }
  PlacedModels read(const ModelLimits& limits = {}) const { return readPlacedModels(world_, worldFile(), limits); }
  // Returns "file: place: reason" of the refusal; empty if there is none.
  std::string refusal(const ModelLimits& limits = {}) const {
    try {
      read(limits);
    } catch (const Error& error) {
      return fs::path(error.subject()).filename().string() + ": " + error.place() + ": " + error.reason();
    }
    return "";
  }

  TemporaryFolder folder_;
  World world_;
};

TEST_F(PlacedModelsTest, AreReadOnceHoweverOftenTheyStand) {
  write("a/box.obj", testObj({1, 1, 1}, ""));
  for (int i = 0; i < 3; ++i) world_.models.push_back(modelFrom({"a/box.obj"}));
  world_.models[1].position = {1, 2, 3};
  world_.models[2].isVisible = false;
  world_.models.push_back(modelFrom({"box.glb"}));
  world_.files["box.glb"] = bytesFrom(testGlb({1, 1, 1}, "1, 0, 0, 1"));
  const PlacedModels all = read();
  EXPECT_EQ(all.models.size(), 2u);
  ASSERT_EQ(all.placed.size(), 3u);
  EXPECT_EQ(all.placed[0].model, 0u);
  EXPECT_EQ(all.placed[1].model, 0u);
  EXPECT_EQ(all.placed[1].position, Vec3d(1, 2, 3));
  EXPECT_EQ(all.placed[2].model, 1u);
  EXPECT_EQ(colour(all.models[1]), (std::array<float, 3>{1, 0, 0}));
}

TEST_F(PlacedModelsTest, AreReadOnceInWhateverOrderTheirFilesAreListed) {
  write("box.obj", testObj({1, 1, 1}, "paint.mtl"));
  world_.models.push_back(modelFrom({"box.obj", "paint.mtl", "a.png"}));
  world_.models.push_back(modelFrom({"./box.obj", "a.png", "paint.mtl"}));
  world_.models.push_back(modelFrom({"box.obj", "a.png"}));
  const PlacedModels all = read();
  EXPECT_EQ(all.models.size(), 2u);
  ASSERT_EQ(all.placed.size(), 3u);
  EXPECT_EQ(all.placed[1].model, 0u);
  EXPECT_EQ(all.placed[2].model, 1u);
}

TEST_F(PlacedModelsTest, ReadNothingBesideTheWorldsFolderButWhatTheWorldLists) {
  write("../paint.mtl", "newmtl paint\nKd 0 1 1\n");
  write("box.obj", testObj({1, 1, 1}, "../paint.mtl"));
  world_.models.push_back(modelFrom({"box.obj"}));
  EXPECT_NE(colour(read().models[0]), (std::array<float, 3>{0, 1, 1}));
  world_.models[0].files.push_back("../paint.mtl");
  EXPECT_EQ(colour(read().models[0]), (std::array<float, 3>{0, 1, 1}));
}

TEST_F(PlacedModelsTest, FindListedFilesOfOtherFoldersByTheirNames) {
  write("models/box.obj", testObj({1, 1, 1}, "Materials/Paint.MTL"));
  write("paint.mtl", "newmtl paint\nKd 0 1 1\nmap_Kd C:\\Users\\me\\wood%201.png\n");
  write("textures/Wood 1.png", "");
  writePng(folder_ / "world/textures/Wood 1.png", ImageU8(2, 3, 3, 9));
  write("models/square.gltf", testGltfJson({1, 1, 1}, "1, 0, 0, 1", R"(, "uri": "my%20box.bin")", ""));
  write("my box.bin", testBoxBuffer({1, 1, 1}));
  world_.models.push_back(modelFrom({"models/box.obj", "paint.mtl", "textures/Wood 1.png"}));
  world_.models.push_back(modelFrom({"models/square.gltf", "my box.bin"}));
  const PlacedModels all = read();
  EXPECT_EQ(colour(all.models[0]), (std::array<float, 3>{0, 1, 1}));
  EXPECT_TRUE(all.models[0].lacking.empty());
  ASSERT_EQ(all.models[0].textures.size(), 1u);
  EXPECT_EQ(all.models[0].textures[0].height, 3);
  EXPECT_EQ(all.models[1].corners.size(), 36u);
}

TEST_F(PlacedModelsTest, AreRefusedIfTheirFilesAreMissingOrTooLarge) {
  write("box.obj", testObj({1, 1, 1}, "paint.mtl"));
  write("paint.mtl", std::string(5000, '\n'));
  world_.models = {modelFrom({"gone.glb"})};
  EXPECT_EQ(refusal(), "gone.glb: : there is no such file");
  world_.models = {modelFrom({"box.obj"})};
  EXPECT_EQ(refusal(), "");
  EXPECT_EQ(refusal({.fileBytes = 4000}), "paint.mtl: : is larger than 0 MiB");
  EXPECT_EQ(refusal({.fileBytes = 10}), "box.obj: : is larger than 0 MiB");
}

TEST_F(PlacedModelsTest, AreRefusedWithAbsolutePaths) {
  write("box.obj", testObj({1, 1, 1}, ""));
  const std::string whole = (folder_ / "world/box.obj").string();
  world_.models = {modelFrom({"box.obj"}), modelFrom({whole})};
  EXPECT_EQ(refusal(), "world.json: models[1].files: '" + whole + "' is an absolute path");
  for (const char* path : {"/etc/hostname", "C:\\a.mtl", "\\a.mtl"}) {
    world_.models = {modelFrom({"box.obj", path})};
    EXPECT_EQ(refusal(), fmt::format("world.json: models[0].files: '{}' is an absolute path", path));
  }
  world_.models = {modelFrom({"https://example.org/box.obj"})};
  EXPECT_EQ(refusal(),
            "world.json: models[0].files: 'https://example.org/box.obj' is on the network, and only browsers "
            "fetch models");
}

TEST_F(PlacedModelsTest, HaveLimitsForAllTogether) {
  write("paint.mtl", "newmtl paint\nmap_Kd wood.png\n");
  writePng(folder_ / "world/wood.png", ImageU8(2, 3, 3, 9));
  for (int i = 0; i < 5; ++i) {
    write(fmt::format("{}.obj", i), testObj({1, 1, 1}, "paint.mtl"));
    world_.models.push_back(modelFrom({fmt::format("{}.obj", i)}));
    world_.models.push_back(world_.models.back());
  }
  EXPECT_EQ(refusal({.triangles = 15, .texturePixels = 8}), "");
  EXPECT_EQ(refusal({.triangles = 14}), "world.json: models[8].files: with those before it has more than 56 triangles");
  EXPECT_EQ(refusal({.texturePixels = 7}),
            "world.json: models[8].files: with those before it has more than 28 texels of textures");
  world_.models.resize(8);
  EXPECT_EQ(refusal({.triangles = 14, .texturePixels = 7}), "");
}

}  // namespace
}  // namespace tessera
