#include "world/model_files.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class ModelFilesTest : public testing::Test {
 protected:
  void writeDisk(const std::string& path) { writeFileAtomically(folder_ / "world" / path, std::string_view(path)); }
  void embed(const std::string& name) {
    const auto bytes = std::as_bytes(std::span(name));
    world_.files[name] = {bytes.begin(), bytes.end()};
  }
  // Returns the content of the file that a model names, which is here its path; "none" if there is none.
  std::string contentAt(const std::string& path, std::vector<std::string> listed = {"a/box.gltf"}) const {
    WorldModel model;
    model.files = std::move(listed);
    const FileIndex embedded = indexEmbedded(world_);
    ModelFiles files(embedded, model, folder_ / "world", 100);
    const auto bytes = files.read(path);
    return bytes ? std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()) : "none";
  }

  TemporaryFolder folder_;
  World world_;
};

TEST_F(ModelFilesTest, AreThoseOfAPathOrElseOfANameAmongTheListedOnes) {
  for (const char* path : {"a/box.gltf", "a/x.png", "textures/x.png", "textures/Wood 1.PNG"}) writeDisk(path);
  EXPECT_EQ(contentAt("a/x.png", {"a/box.gltf", "textures/x.png", "a/x.png"}), "a/x.png");
  EXPECT_EQ(contentAt("b/x.png", {"a/box.gltf", "textures/x.png", "a/x.png"}), "textures/x.png");
  EXPECT_EQ(contentAt("A/X.png", {"a/box.gltf", "textures/x.png", "a/x.png"}), "a/x.png");
  for (const char* path : {"a/wood%201.png", "a/C:/Users/me/wood 1.png", "/home/me/WOOD 1.png", "a\\Wood%201.PNG"}) {
    EXPECT_EQ(contentAt(path, {"a/box.gltf", "textures/Wood 1.PNG"}), "textures/Wood 1.PNG") << path;
    EXPECT_EQ(contentAt(path), "none") << path;
  }
  EXPECT_EQ(contentAt("x.png", {"a/box.gltf", "lost/x.png", "textures/x.png"}), "textures/x.png");
}

TEST_F(ModelFilesTest, AreEmbeddedOrOnDisk) {
  writeDisk("a/x.png");
  writeDisk("a/y.png");
  embed("A/x.png");
  embed("b/z.png");
  EXPECT_EQ(contentAt("a/x.png", {"a/box.gltf", "a/x.png"}), "A/x.png");
  EXPECT_EQ(contentAt("a/y.png", {"a/box.gltf", "a/y.png"}), "a/y.png");
  EXPECT_EQ(contentAt("a/z.png"), "b/z.png");
  embed("a/x.png");
  EXPECT_EQ(contentAt("a/x.png", {"a/box.gltf", "a/x.png"}), "a/x.png");
}

TEST_F(ModelFilesTest, HaveOneMaterialLibraryWhateverItsName) {
  writeDisk("a/Paint.MTL");
  EXPECT_EQ(contentAt("a/box.mtl", {"a/box.obj", "a/Paint.MTL"}), "a/Paint.MTL");
  EXPECT_EQ(contentAt("a/box.png", {"a/box.obj", "a/Paint.MTL"}), "none");
  EXPECT_EQ(contentAt("a/box.mtl", {"a/box.obj"}), "none");
  embed("other.mtl");
  EXPECT_EQ(contentAt("a/box.mtl", {"a/box.obj", "other.mtl"}), "other.mtl");
  EXPECT_EQ(contentAt("a/box.mtl", {"a/box.obj"}), "other.mtl");
  EXPECT_EQ(contentAt("a/box.mtl", {"a/box.obj", "a/Paint.MTL"}), "none");
}

TEST_F(ModelFilesTest, ThatOnlyTheModelNamesLieInTheWorldsFolder) {
  writeDisk("a/x 1.png");
  writeDisk("../secret.png");
  EXPECT_EQ(contentAt("a/x 1.png"), "a/x 1.png");
  EXPECT_EQ(contentAt("a/x%201.png"), "a/x 1.png");
  const std::string whole = (folder_ / "secret.png").string();
  for (const std::string& path : {std::string("../secret.png"), std::string("a/..%2F..%2Fsecret.png"), whole,
                                  "%2F" + whole.substr(1), "a/../" + whole}) {
    EXPECT_EQ(contentAt(path), "none") << path;
  }
  EXPECT_EQ(contentAt("../secret.png", {"a/box.gltf", "../secret.png"}), "../secret.png");
}

TEST_F(ModelFilesTest, AreRefusedIfTheyAreTooLarge) {
  writeFileAtomically(folder_ / "box.obj", std::string_view("long text"));
  WorldModel model;
  model.files = {"box.obj"};
  const FileIndex none;
  ModelFiles files(none, model, folder_.path(), 8);
  EXPECT_NO_THROW(files.requireSmallFiles());
  EXPECT_FALSE(files.read("box.obj"));
  EXPECT_THROW(files.requireSmallFiles(), Error);
}

}  // namespace
}  // namespace tessera
