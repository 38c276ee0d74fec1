#include "world/model.h"

#include <gtest/gtest.h>

#include <map>

#include "base/error.h"
#include "base/image_io.h"
#include "world/testing/test_models.h"

namespace tessera {
namespace {

using Files = std::map<std::string, std::string>;

Model readFrom(const Files& files, const std::string& path, const ModelLimits& limits = {}) {
  return readModel(
      path,
      [&](const std::string& name) -> std::optional<Bytes> {
        const auto file = files.find(name);
        if (file == files.end()) return std::nullopt;
        const auto bytes = std::as_bytes(std::span(file->second));
        return Bytes(bytes.begin(), bytes.end());
      },
      limits);
}

std::string reasonOfRefusal(const Files& files, const std::string& path, const ModelLimits& limits = {}) {
  try {
    readFrom(files, path, limits);
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), path);
    return error.reason();
  }
  return "";
}

// Expects a box of 2 x 3 x 4 m, of which the last is its height, and that all triangles are seen from outside.
void expectBox(const Model& model) {
  Vec3f low = Vec3f::Constant(1e9f), high = -low;
  for (const ModelVertex& vertex : model.vertices) {
    low = low.cwiseMin(vertex.position);
    high = high.cwiseMax(vertex.position);
  }
  EXPECT_TRUE(low.isApprox(Vec3f(-1, -1.5f, -2), 1e-4f)) << low.transpose();
  EXPECT_TRUE(high.isApprox(Vec3f(1, 1.5f, 2), 1e-4f)) << high.transpose();
  ASSERT_EQ(model.corners.size(), 36u);
  for (size_t first = 0; first < 36; first += 3) {
    const auto corner = [&](size_t k) { return model.vertices[model.corners[first + k]]; };
    const Vec3f a = corner(0).position, b = corner(1).position, c = corner(2).position;
    const Vec3f across = (b - a).cross(c - a).normalized();
    EXPECT_GT(across.dot(a + b + c), 0);
    for (size_t k = 0; k < 3; ++k) EXPECT_GT(corner(k).normal.dot(across), 0.99f);
  }
}

TEST(Model, IsReadFromEveryFormatInMetresWithItsHeightAlongZ) {
  const Vec3d size(2, 3, 4);
  const Model ofGltf = readFrom({{"a/box.gltf", testGltf(size, "1, 0, 0, 1")}}, "a/box.gltf");
  expectBox(ofGltf);
  EXPECT_EQ(ofGltf.materials[0].baseColour, (std::array<float, 3>{1, 0, 0}));
  EXPECT_FALSE(ofGltf.materials[0].isDoubleSided);
  expectBox(readFrom({{"box.glb", testGlb(size, "1, 0, 0, 1")}}, "box.glb"));
  const Model ofObj =
      readFrom({{"box.OBJ", testObj(size, "box.mtl")}, {"box.mtl", "newmtl paint\nKd 0.5 0 1\n"}}, "box.OBJ");
  expectBox(ofObj);
  const ModelMaterial& paint = ofObj.materials[ofObj.vertices[0].material];
  EXPECT_NEAR(paint.baseColour[0], 0.214f, 1e-3);  // linear
  EXPECT_NEAR(paint.baseColour[2], 1, 1e-3);
  expectBox(readFrom({{"box.fbx", testFbx(100 * size)}}, "box.fbx"));  // whose unit is 1 cm
}

TEST(Model, HasTheTexturesOfItsFilesAndNamesThoseThatAreMissing) {
  ImageU8 image(2, 1, 3);
  image.pixels = {255, 0, 0, 0, 255, 0};
  const Bytes png = encodePng(image);
  Files files = {{"m/box.obj", testObj({1, 1, 1}, "box.mtl")},
                 {"m/box.mtl", "newmtl paint\nmap_Kd textures/a b.png\n"},
                 {"m/textures/a b.png", std::string(reinterpret_cast<const char*>(png.data()), png.size())}};
  const Model model = readFrom(files, "m/box.obj");
  ASSERT_EQ(model.textures.size(), 1u);
  EXPECT_EQ(model.textures[0].pixels, (std::vector<uint8_t>{255, 0, 0, 255, 0, 255, 0, 255}));
  EXPECT_EQ(model.materials[model.vertices[0].material].texture, 0);
  EXPECT_TRUE(model.lacking.empty());
  files.erase("m/textures/a b.png");
  const Model without = readFrom(files, "m/box.obj");
  EXPECT_EQ(without.lacking, std::vector<std::string>{"textures/a b.png"});
  EXPECT_EQ(without.materials[without.vertices[0].material].texture, -1);
}

TEST(Model, DrawsTransparentMaterialsWhereTheyHideHalfOfWhatIsBehind) {
  const auto cutoff = [](const std::string& mode) {
    return readFrom({{"a.gltf", testGltf({1, 1, 1}, "1, 1, 1, 0.75", mode)}}, "a.gltf").materials[0].cutoff;
  };
  EXPECT_EQ(cutoff(R"(, "alphaMode": "BLEND", "doubleSided": true)"), 0.5f);
  EXPECT_FLOAT_EQ(cutoff(R"(, "alphaMode": "MASK", "alphaCutoff": 0.25)"), 0.25f);
  EXPECT_EQ(cutoff(""), 0);
}

TEST(Model, IsRefusedWithAReasonWhateverItsFileHolds) {
  EXPECT_EQ(reasonOfRefusal({}, "a.glb"), "there is no such file");
  EXPECT_EQ(reasonOfRefusal({{"a.stl", ""}}, "a.stl"), "is no model");
  EXPECT_EQ(reasonOfRefusal({{"a.obj", "v 1 2 3\n"}}, "a.obj").substr(0, 14), "cannot be read");
  ModelLimits limits;
  limits.fileBytes = 10;
  const std::string obj = testObj({1, 1, 1}, "");
  EXPECT_EQ(reasonOfRefusal({{"a.obj", obj}}, "a.obj", limits), "is larger than 0 MiB");
  limits = {};
  limits.triangles = 11;
  EXPECT_EQ(reasonOfRefusal({{"a.obj", obj}}, "a.obj", limits), "has more than 11 triangles");
  for (const auto& [path, whole] : Files{{"a.gltf", testGltf({1, 1, 1}, "1, 0, 0, 1")},
                                         {"a.glb", testGlb({1, 1, 1}, "1, 0, 0, 1")},
                                         {"a.fbx", testFbx({1, 1, 1})},
                                         {"a.obj", obj}}) {
    size_t refusals = 0, readings = 0;
    for (size_t size = 0; size < whole.size(); size += 1 + whole.size() / 60, ++readings) {
      try {
        readFrom({{path, whole.substr(0, size)}}, path);
      } catch (const Error& error) {
        EXPECT_EQ(error.subject(), path);
        ++refusals;
      }
    }
    // The start of an OBJ is often one itself.
    EXPECT_GE(refusals, path == "a.obj" ? 1 : readings * 9 / 10) << path;
    EXPECT_EQ(reasonOfRefusal({{path, whole}}, path), "");
  }
}

TEST(Model, IsRefusedIfItsReaderCrashes) {
  std::string nested = "; FBX 7.3.0 project file\nFBXHeaderExtension:  {\nFBXVersion: 7300\n}\nObjects:  ";
  for (size_t i = 0; i < 500'000; ++i) nested += "{\nA: ";
  const std::string reason = reasonOfRefusal({{"a.fbx", nested}}, "a.fbx");
  EXPECT_TRUE(reason.starts_with("cannot be read: it ")) << reason;
}

}  // namespace
}  // namespace tessera
