#include "tiles/content_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "tiles/glb.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint32_t kVertices = 34962, kIndices = 34963, kFloat = 5126, kShort = 5123;
constexpr std::array<std::array<float, 3>, 3> kPlaces = {{{0, 0, 0}, {2, 0, 1}, {0, 3, 0}}};  // z up
constexpr std::array<std::array<float, 2>, 3> kTexturePlaces = {{{0, 0}, {1, 0}, {0, 1}}};
constexpr std::array<uint16_t, 3> kCorners = {0, 1, 2};
// A PNG of one white pixel.
constexpr std::array<uint8_t, 69> kPng = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00,
    0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0xf8, 0xff, 0xff, 0x3f, 0x00, 0x05, 0xfe, 0x02, 0xfe, 0x0d,
    0xef, 0x46, 0xb8, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
constexpr std::array<uint8_t, 5> kPayload = {1, 2, 3, 4, 5};

template <class T>
std::span<const std::byte> asByteSpan(const T& array) {
  return std::as_bytes(std::span(array));
}

// A file with a payload and, for other programs, a textured triangle.
Bytes texturedTriangle() {
  ContentFileWriter writer;
  const Json payload = writer.add(asByteSpan(kPayload), kRawBytes);
  GltfScene scene;
  scene.accessors = {{{"bufferView", writer.addView(asByteSpan(kPlaces), kVertices)},
                      {"componentType", kFloat},
                      {"count", 3},
                      {"type", "VEC3"},
                      {"min", {0, 0, 0}},
                      {"max", {2, 3, 1}}},
                     {{"bufferView", writer.addView(asByteSpan(kTexturePlaces), kVertices)},
                      {"componentType", kFloat},
                      {"count", 3},
                      {"type", "VEC2"}},
                     {{"bufferView", writer.addView(asByteSpan(kCorners), kIndices)},
                      {"componentType", kShort},
                      {"count", 3},
                      {"type", "SCALAR"}}};
  scene.images = {{{"bufferView", writer.addView(asByteSpan(kPng))}, {"mimeType", "image/png"}}};
  scene.samplers = {{{"magFilter", 9729}, {"minFilter", 9987}}};
  scene.textures = {{{"source", 0}, {"sampler", 0}}};
  scene.materials = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}},
                      {"extensions", {{"KHR_materials_unlit", Json::object()}}}}};
  const Json primitive = {{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}, {"indices", 2}, {"material", 0}};
  scene.meshes = {{{"primitives", Json::array({primitive})}}};
  scene.nodes = {{{"mesh", 0}}};
  scene.roots = {0};
  scene.extensionsUsed = {"KHR_materials_unlit"};
  return writer.finish("volume", {{"payload", payload}}, scene);
}

Json parseAsset(const Bytes& file) {
  const auto glb = decodeGlb(file);
  return glb ? Json::parse(glb->json) : Json();
}

TEST(ContentFile, RoundTripsThePayloadBesideATexturedTriangle) {
  const Bytes file = texturedTriangle();
  std::string reason;
  const auto content = decodeContentFile(file, "volume", reason);
  ASSERT_TRUE(content) << reason;
  const auto payload = content->bufferViewBytes(content->ours["payload"], kRawBytes);
  ASSERT_TRUE(payload);
  EXPECT_TRUE(std::equal(payload->begin(), payload->end(), asByteSpan(kPayload).begin(), asByteSpan(kPayload).end()));
  const Json asset = parseAsset(file);
  const auto viewIs = [&](size_t view, std::span<const std::byte> expected) {
    const auto& is = content->views.at(view);
    return std::equal(is.begin(), is.end(), expected.begin(), expected.end());
  };
  EXPECT_TRUE(viewIs(asset["accessors"][0]["bufferView"], asByteSpan(kPlaces)));
  EXPECT_TRUE(viewIs(asset["accessors"][1]["bufferView"], asByteSpan(kTexturePlaces)));
  EXPECT_TRUE(viewIs(asset["accessors"][2]["bufferView"], asByteSpan(kCorners)));
  EXPECT_TRUE(viewIs(asset["images"][0]["bufferView"], asByteSpan(kPng)));
  EXPECT_EQ(asset["bufferViews"][1]["target"], kVertices);
  EXPECT_EQ(asset["bufferViews"][3]["target"], kIndices);
  EXPECT_FALSE(asset["bufferViews"][4].contains("target"));
}

TEST(ContentFile, TurnsZUpIntoYUpAboveItsNodes) {
  const Json asset = parseAsset(texturedTriangle());
  ASSERT_EQ(asset["scenes"][0]["nodes"], Json({1}));
  const Json& turned = asset["nodes"][1];
  EXPECT_EQ(turned["children"], Json({0}));
  const auto matrix = turned["matrix"].get<std::array<float, 16>>();
  const std::array<float, 3> inTile = {2, 3, 5}, expected = {2, 5, -3};
  for (size_t row = 0; row < 3; ++row) {
    float turnedTo = matrix[12 + row];
    for (size_t column = 0; column < 3; ++column) turnedTo += matrix[4 * column + row] * inTile[column];
    EXPECT_EQ(turnedTo, expected[row]);
  }
}

TEST(ContentFile, DoesNotRequireOtherProgramsToKnowItsExtension) {
  const Json asset = parseAsset(texturedTriangle());
  EXPECT_EQ(asset["extensionsUsed"], Json({"TESSERA_content", "KHR_materials_unlit"}));
  EXPECT_FALSE(asset.contains("extensionsRequired"));
}

TEST(ContentFile, IsAnEmptySceneWhereThereIsNothingToDraw) {
  ContentFileWriter writer;
  const Json payload = writer.add(asByteSpan(kPayload), kRawBytes);
  const Bytes file = writer.finish("volume", {{"payload", payload}});
  const auto glb = decodeGlb(file);
  ASSERT_TRUE(glb);
  EXPECT_EQ(glb->json.substr(0, glb->json.find_last_not_of(' ') + 1),
            R"({"asset":{"version":"2.0","generator":"tessera"},"extensionsUsed":["TESSERA_content"],"scene":0,)"
            R"("scenes":[{}],"buffers":[{"byteLength":5}],"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":5}],)"
            R"("extensions":{"TESSERA_content":{"version":1,"representation":"volume",)"
            R"("payload":{"bufferView":0,"mimeType":"application/octet-stream"}}}})");
}

TEST(ContentFile, RefusesViewsOfATriangleThatLieOutsideItsBytes) {
  const Bytes file = texturedTriangle();
  const auto glb = decodeGlb(file);
  for (size_t view = 0; view < 5; ++view) {
    Json asset = parseAsset(file);
    asset["bufferViews"][view]["byteLength"] = 1000;
    std::string reason;
    EXPECT_FALSE(decodeContentFile(encodeGlb(asset.dump(), glb->bytes), "volume", reason));
    EXPECT_EQ(reason, "its buffer views do not lie within its bytes");
  }
}

}  // namespace
}  // namespace tessera
