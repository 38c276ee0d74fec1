#include "world/placed_models.h"

#include <gtest/gtest.h>

#include "base/error.h"
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

float redness(const Model& model) {
  return model.materials[model.vertices[0].material].baseColour[0];
}

TEST(PlacedModels, AreReadOnceHoweverOftenTheyStand) {
  TemporaryFolder folder;
  writeFileAtomically(folder / "a/box.obj", std::string_view(testObj({1, 1, 1}, "")));
  World world;
  for (int i = 0; i < 3; ++i) world.models.push_back(modelFrom({"a/box.obj"}));
  world.models[1].position = {1, 2, 3};
  world.models[2].isVisible = false;
  world.models.push_back(modelFrom({"box.glb"}));
  world.files["box.glb"] = bytesFrom(testGlb({1, 1, 1}, "1, 0, 0, 1"));
  const PlacedModels read = readPlacedModels(world, folder / "world.json");
  EXPECT_EQ(read.models.size(), 2u);
  ASSERT_EQ(read.placed.size(), 3u);
  EXPECT_EQ(read.placed[1].model, 0u);
  EXPECT_EQ(read.placed[1].position, Vec3d(1, 2, 3));
  EXPECT_EQ(read.placed[2].model, 1u);
  world.models.push_back(modelFrom({"gone.glb"}));
  EXPECT_THROW(readPlacedModels(world, folder / "world.json"), Error);
}

TEST(PlacedModels, ReadNothingBesideTheWorldsFolderButWhatTheWorldLists) {
  TemporaryFolder folder;
  writeFileAtomically(folder / "paint.mtl", std::string_view("newmtl paint\nKd 0 1 1\n"));
  writeFileAtomically(folder / "world/box.obj", std::string_view(testObj({1, 1, 1}, "../paint.mtl")));
  World world;
  world.models.push_back(modelFrom({"box.obj"}));
  EXPECT_GT(redness(readPlacedModels(world, folder / "world/world.json").models[0]), 0.1f);
  world.models[0].files.push_back("../paint.mtl");
  EXPECT_EQ(redness(readPlacedModels(world, folder / "world/world.json").models[0]), 0);
}

}  // namespace
}  // namespace tessera
