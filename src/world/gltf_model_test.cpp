#include "world/gltf_model.h"

#include <gtest/gtest.h>

#include <ctime>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/image_io.h"
#include "world/testing/test_models.h"

namespace tessera {
namespace {

using nlohmann::json;

std::string bytesOf16(std::initializer_list<int> values) {
  std::string bytes;
  for (const int value : values) bytes += {static_cast<char>(value & 255), static_cast<char>(value >> 8 & 255)};
  return bytes;
}

// A file of one triangle with corners (0, 0, 0), (1, 0, 0) and (0, 1, 0), y up, whose parts tests replace.
json triangleFile() {
  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::string buffer(reinterpret_cast<const char*>(corners), sizeof corners);
  json file = json::parse(R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}]})");
  file["buffers"] = {{{"byteLength", 36}, {"uri", "data:application/octet-stream;base64," + testBase64(buffer)}}};
  return file;
}

// Adds an accessor of these bytes, in a buffer of its own, and returns its number.
size_t addAccessor(json& file, const std::string& bytes, json accessor) {
  accessor["bufferView"] = file["bufferViews"].size();
  file["bufferViews"].push_back({{"buffer", file["buffers"].size()}, {"byteLength", bytes.size()}});
  file["buffers"].push_back({{"byteLength", bytes.size()}, {"uri", "data:;base64," + testBase64(bytes)}});
  file["accessors"].push_back(accessor);
  return file["accessors"].size() - 1;
}

Model readFrom(const json& file, const std::map<std::string, Bytes>& others = {}, const ModelLimits& limits = {}) {
  return readModel(
      "a.gltf",
      [&](const std::string& name) -> std::optional<Bytes> {
        if (name == "a.gltf") {
          const std::string text = file.dump();
          const auto bytes = std::as_bytes(std::span(text));
          return Bytes(bytes.begin(), bytes.end());
        }
        const auto other = others.find(name);
        return other == others.end() ? std::nullopt : std::optional(other->second);
      },
      limits);
}

std::string refusal(const json& file, const ModelLimits& limits = {}) {
  try {
    readFrom(file, {}, limits);
  } catch (const Error& error) {
    EXPECT_FALSE(error.remedy().empty());
    return error.place() + ": " + error.reason();
  }
  return "";
}

std::vector<Vec3f> cornersFrom(const Model& model) {
  std::vector<Vec3f> corners;
  for (const uint32_t corner : model.corners) corners.push_back(model.vertices[corner].position);
  return corners;
}

TEST(GltfModel, PlacesMeshesByTheMatricesOfTheirNodes) {
  json file = triangleFile();
  file["nodes"] = json::parse(R"([{"children": [1, 2], "translation": [0, 10, 0], "rotation": [0, 0, 0.6, 0.8]},
    {"mesh": 0, "scale": [2, 1, -1]}, {"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,5,1], "mesh": 0}])");
  const std::vector<Vec3f> corners = cornersFrom(readFrom(file));
  ASSERT_EQ(corners.size(), 6u);
  // The rotation has a cosine of 0.28 and a sine of 0.96; y is up in the file, z here.
  EXPECT_TRUE(corners[0].isApprox(Vec3f(0, 0, 10), 1e-5f)) << corners[0].transpose();
  EXPECT_TRUE(corners[1].isApprox(Vec3f(-0.96f, 0, 10.28f), 1e-5f)) << "mirrored, thus turned round";
  EXPECT_TRUE(corners[2].isApprox(Vec3f(0.56f, 0, 11.92f), 1e-5f)) << corners[2].transpose();
  EXPECT_TRUE(corners[4].isApprox(Vec3f(0.28f, -5, 10.96f), 1e-5f)) << corners[4].transpose();
}

TEST(GltfModel, ReadsStripsFansAndOnlyTheVerticesThatAreUsed) {
  json file = triangleFile();
  std::string corners;
  for (const float x : {9.f, 9.f, 9.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 1.f, 1.f, 0.f}) {
    corners.append(reinterpret_cast<const char*>(&x), 4);
  }
  json& primitive = file["meshes"][0]["primitives"][0];
  primitive["attributes"]["POSITION"] =
      addAccessor(file, corners, {{"componentType", 5126}, {"count", 5}, {"type", "VEC3"}});
  primitive["attributes"]["NORMAL"] = addAccessor(
      file, std::string(15, '\x7f'), {{"componentType", 5120}, {"count", 5}, {"type", "VEC3"}, {"normalized", true}});
  primitive["indices"] =
      addAccessor(file, "\x01\x02\x03\x04", {{"componentType", 5121}, {"count", 4}, {"type", "SCALAR"}});
  primitive["mode"] = 5;
  const Model strip = readFrom(file);
  EXPECT_EQ(strip.vertices.size(), 4u);
  EXPECT_EQ(strip.corners, (std::vector<uint32_t>{0, 1, 2, 1, 3, 2}));
  EXPECT_TRUE(strip.vertices[0].normal.isApprox(Vec3f(1, -1, 1).normalized(), 1e-5f));
  primitive["mode"] = 6;
  EXPECT_EQ(readFrom(file).corners, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
  primitive["mode"] = 1;
  EXPECT_NE(refusal(file).find("holds nothing to draw"), std::string::npos);
}

TEST(GltfModel, ReadsQuantisedNumbersTransformsOfPlacesAndSparseAccessors) {
  json file = triangleFile();
  json& primitive = file["meshes"][0]["primitives"][0];
  primitive["attributes"]["TEXCOORD_1"] =
      addAccessor(file, bytesOf16({0, 0, 65535, 0, 0, 65535}),
                  {{"componentType", 5123}, {"count", 3}, {"type", "VEC2"}, {"normalized", true}});
  primitive["attributes"]["COLOR_0"] =
      addAccessor(file, std::string("\xff\x00\x33\x00\xff\x00\x00\x00\xff", 9),
                  {{"componentType", 5121}, {"count", 3}, {"type", "VEC3"}, {"normalized", true}});
  primitive["material"] = 0;
  ImageU8 image(1, 1, 3, 100);
  file["images"] = {{{"uri", "a%20b.png"}}};
  file["textures"] = {{{"source", 0}}};
  file["materials"] = json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
    {"KHR_texture_transform": {"texCoord": 1, "offset": [0.25, 0.5], "scale": [2, 1], "rotation": 1.5707963267948966}}}}}])");
  // The second corner is replaced.
  const size_t where = addAccessor(file, bytesOf16({1}), {});
  const float moved[] = {3, 0, 0};
  const size_t what = addAccessor(file, std::string(reinterpret_cast<const char*>(moved), 12), {});
  file["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", file["accessors"][where]["bufferView"]}, {"componentType", 5123}}},
      {"values", {{"bufferView", file["accessors"][what]["bufferView"]}}}};
  const Model model = readFrom(file, {{"a b.png", encodePng(image)}});
  ASSERT_EQ(model.vertices.size(), 3u);
  EXPECT_EQ(model.vertices[1].position, Vec3f(3, 0, 0));
  EXPECT_EQ(model.vertices[0].colour, 0xff3300ffu);
  EXPECT_EQ(model.textures.size(), 1u);
  const std::array<float, 2> places[] = {{0.25f, 0.5f}, {0.25f, -1.5f}, {1.25f, 0.5f}};
  for (size_t i = 0; i < 3; ++i)
    for (size_t c = 0; c < 2; ++c) EXPECT_NEAR(model.vertices[i].place[c], places[i][c], 1e-5f) << i;
}

TEST(GltfModel, UsesMapsOfSurfaceAndEmissionOrElseNeitherMapNorFactor) {
  json file = triangleFile();
  file["meshes"][0]["primitives"][0]["material"] = 0;
  file["images"] = {{{"uri", "surface.png"}}, {{"uri", "glow.png"}}};
  file["textures"] = {{{"source", 0}}, {{"source", 1}}};
  file["materials"] = json::parse(R"([{"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}},
    "emissiveTexture": {"index": 1}, "emissiveFactor": [1, 0.5, 0]}])");
  const Bytes png = encodePng(ImageU8(1, 1, 3, 100));
  const ModelMaterial with = readFrom(file, {{"surface.png", png}, {"glow.png", png}}).materials[0];
  EXPECT_EQ(with.surfaceTexture, 0);
  EXPECT_EQ(with.emissionTexture, 1);
  EXPECT_EQ(with.metalness, 1);
  EXPECT_EQ(with.emission, (std::array<float, 3>{1, 0.5f, 0}));
  const Model model = readFrom(file);
  EXPECT_EQ(model.lacking, (std::vector<std::string>{"surface.png", "glow.png"}));
  EXPECT_EQ(model.materials[0].metalness, 0);
  EXPECT_EQ(model.materials[0].roughness, 1);
  EXPECT_EQ(model.materials[0].emission, (std::array<float, 3>{0, 0, 0}));
  // Another set of places than that of the first texture cannot be used.
  file["materials"][0]["emissiveTexture"]["texCoord"] = 1;
  EXPECT_EQ(readFrom(file, {{"surface.png", png}, {"glow.png", png}}).materials[0].emissionTexture, -1);
}

TEST(GltfModel, IsRefusedWithThePlaceOfTheError) {
  const auto changed = [](const char* pointer, const json& value) {
    json file = triangleFile();
    file[json::json_pointer(pointer)] = value;
    return refusal(file);
  };
  EXPECT_EQ(changed("/asset/version", "1.0"), "asset: is not glTF 2.0");
  EXPECT_EQ(changed("/accessors/0/count", 4), "accessors[0]: is beyond its buffer");
  EXPECT_EQ(changed("/accessors/0/byteOffset", 4000000000u), "accessors[0]: is beyond its buffer");
  EXPECT_EQ(changed("/accessors/0/componentType", 7), "accessors[0]: has a type that is not read");
  EXPECT_EQ(changed("/accessors/0/bufferView", 1), "bufferViews[1]: is missing");
  EXPECT_EQ(changed("/bufferViews/0/byteLength", 37), "bufferViews[0]: is beyond its buffer");
  EXPECT_EQ(changed("/buffers/0/byteLength", 37), "buffers[0]: is cut off");
  EXPECT_EQ(changed("/buffers/0/uri", "gone.bin"), "buffers[0]: needs gone.bin");
  EXPECT_EQ(changed("/buffers/0/uri", "data:;base64,AB?"), "buffers[0]: has data that is not base64");
  EXPECT_EQ(changed("/buffers/0/uri", "https://example.org/a.bin"),
            "buffers[0]: asks for https://example.org/a.bin, and nothing is fetched for a model");
  EXPECT_EQ(changed("/nodes/0/mesh", 1), "meshes[1]: is missing");
  EXPECT_EQ(changed("/scenes/0/nodes", json({1})), "scenes[0].nodes: name no node");
  EXPECT_EQ(changed("/meshes/0/primitives/0/indices", 7), "accessors[7]: has no count");
  EXPECT_EQ(changed("/meshes/0/primitives/0/material", 0), "meshes[0].primitives[0].material: is missing");
  EXPECT_EQ(changed("/meshes/0/primitives/0/attributes", json::object()), ": holds nothing to draw");
  EXPECT_EQ(changed("/extensionsRequired", json({"KHR_draco_mesh_compression"})),
            ": uses KHR_draco_mesh_compression, which is not read here");
  EXPECT_NE(refusal(json(5)).find("is not glTF 2.0"), std::string::npos);
}

TEST(GltfModel, TakesLittleTimeAndMemoryWhateverAFileClaims) {
  const std::clock_t start = std::clock();  // of this process: other programs may keep it waiting
  json file = triangleFile();
  file["accessors"][0] = {{"componentType", 5126}, {"count", 4'000'000'000u}, {"type", "VEC3"}};
  EXPECT_NE(refusal(file).find("has more than 4000000 triangles"), std::string::npos);
  // Nodes that share their children would be copied 2^30 times.
  file = triangleFile();
  file["nodes"] = json::array();
  for (size_t i = 0; i < 30; ++i) file["nodes"].push_back({{"children", {i + 1, i + 1}}});
  file["nodes"].push_back({{"mesh", 0}});
  EXPECT_EQ(refusal(file), "nodes[0].children: name a node that has another parent, or is its own ancestor");
  file["nodes"] = {{{"children", {0}}}};
  EXPECT_EQ(refusal(file), "scenes[0].nodes: name a node that has a parent");
  // A long chain of nodes.
  file["nodes"] = json::array();
  for (size_t i = 0; i < 100'000; ++i) file["nodes"].push_back({{"children", {i + 1}}});
  file["nodes"].push_back({{"mesh", 0}});
  EXPECT_EQ(refusal(file), "nodes[257]: is nested too deep");
  // Meshes that use the same corners again and again.
  file = triangleFile();
  file["meshes"][0]["primitives"][0]["indices"] = 1;
  file["accessors"].push_back({{"componentType", 5125}, {"count", 100'000}, {"type", "SCALAR"}});
  ModelLimits limits;
  limits.triangles = 400'000;
  for (size_t i = 0; i < 200; ++i) file["meshes"][0]["primitives"].push_back(file["meshes"][0]["primitives"][0]);
  EXPECT_NE(refusal(file, limits).find("has more than 400000 triangles"), std::string::npos);
  // Many nodes whose mesh has many primitives without triangles.
  file = triangleFile();
  file["nodes"] = json(json::array_t(20'000, json{{"mesh", 0}}));
  file["scenes"] = json::array();
  file["meshes"][0]["primitives"] = json(json::array_t(20'000, json{{"mode", 0}}));
  EXPECT_EQ(refusal(file), "accessors: are read too often");
  // Materials that share a large image, and sparse accessors with much besides their numbers.
  file = triangleFile();
  file["images"] = {{{"uri", "data:image/png;base64," + std::string(4'000'000, 'A')}}};
  file["textures"] = {{{"source", 0}}};
  for (size_t i = 0; i < 2000; ++i) file["materials"].push_back({{"emissiveTexture", {{"index", 0}}}});
  EXPECT_EQ(readFrom(file).lacking.size(), 1u);
  const std::string nested = std::string(1'000'000, '[');
  const auto reader = [&](const std::string&) -> std::optional<Bytes> {
    const auto bytes = std::as_bytes(std::span(nested));
    return Bytes(bytes.begin(), bytes.end());
  };
  EXPECT_THROW(readModel("a.gltf", reader), Error);
#ifdef __SANITIZE_THREAD__
  constexpr int kSeconds = 80;  // everything is about nine times as slow
#else
  constexpr int kSeconds = 20;
#endif
  EXPECT_LT((std::clock() - start) / CLOCKS_PER_SEC, kSeconds);
}

TEST(GltfModel, OfGlbIsReadWholeOrRefused) {
  const std::string whole = testGlb({1, 1, 1}, "1, 0, 0, 1");
  for (size_t size = 0; size <= whole.size(); ++size) {
    const auto reader = [&](const std::string&) -> std::optional<Bytes> {
      const auto bytes = std::as_bytes(std::span(whole).first(size));
      return Bytes(bytes.begin(), bytes.end());
    };
    if (size == whole.size()) {
      EXPECT_EQ(readModel("a.glb", reader).corners.size(), 36u);
    } else {
      EXPECT_THROW(readModel("a.glb", reader), Error) << size;
    }
  }
}

}  // namespace
}  // namespace tessera
