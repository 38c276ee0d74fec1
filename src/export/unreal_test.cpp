#include "export/unreal.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/image_io.h"
#include "export/hlsl_decoder.h"
#include "export/mesh_level.h"
#include "representations/mesh/content/infer_maps.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/testing/random_mesh.h"
#include "tiles/bc4.h"
#include "tiles/glb.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

const fs::path kUnrealScene = TESSERA_GOLDEN_MESH;

class UnrealExportTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("tessera-unreal-" + std::to_string(::getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  nlohmann::json exportedJson(const fs::path& scene = kUnrealScene, uint32_t level = 0) {
    exported_ = exportUnreal(scene, root_ / "out", {.level = level, .threads = 1});
    return nlohmann::json::parse(readTextFile(root_ / "out" / "scene.json"));
  }

  fs::path root_;
  UnrealExport exported_;
};

// Calls use(json, part) for each part of a level with its entry in scene.json.
template <class Use>
void forEachPart(const fs::path& scene, uint32_t level, const nlohmann::json& json, const Use& use) {
  const MeshLevel contents(scene, level, "unreal");
  size_t next = 0;
  for (const LevelContent& listed : contents.contents()) {
    MeshContent mesh = contentAs<MeshContent>(*contents.read(listed));
    inferMapsOnCpu(mesh, 1);
    for (size_t i = 0; i < mesh.parts.size(); ++i) {
      ASSERT_LT(next, json["parts"].size());
      EXPECT_EQ(json["parts"][next]["name"], partName(listed, mesh, i));
      use(json["parts"][next++], mesh.parts[i]);
    }
  }
  EXPECT_EQ(next, json["parts"].size());
}

uint32_t wordAt(const Bytes& bytes, size_t at) {
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + at, sizeof(word));
  return word;
}

// Compares the maps of a scene, as a GPU decodes them, with the numbers of its texels.
void expectMaps(const fs::path& scene, uint32_t level, const nlohmann::json& json, const fs::path& folder) {
  forEachPart(scene, level, json, [&](const nlohmann::json& entry, const PatchSet& part) {
    const uint32_t width = part.textureWidth(), height = part.textureHeight();
    ASSERT_EQ(entry["maps"].size(), 9u);
    for (size_t map = 0; map < 9; ++map) {
      const Bytes dds = readFile(folder / entry["maps"][map].get<std::string>());
      ASSERT_EQ(dds.size(), 148 + size_t{width} * height / 2);
      EXPECT_EQ(std::memcmp(dds.data(), "DDS ", 4), 0);
      EXPECT_EQ(wordAt(dds, 12), height);
      EXPECT_EQ(wordAt(dds, 16), width);
      EXPECT_EQ(std::memcmp(dds.data() + 84, "DX10", 4), 0);
      EXPECT_EQ(wordAt(dds, 128), 80u) << "DXGI_FORMAT_BC4_UNORM";
      const ImageU8 image = readImage(folder / entry["images"][map].get<std::string>()).image;
      ASSERT_EQ(image.channels, 1);
      ASSERT_EQ(image.width, static_cast<int>(width));
      ASSERT_EQ(image.height, static_cast<int>(height));
      const auto* const blocks = reinterpret_cast<const uint8_t*>(dds.data() + 148);
      for (uint32_t patch = 0; patch < part.patches; ++patch) {
        const uint32_t column = (patch * 3 + static_cast<uint32_t>(map)) % part.patchEdge, row = patch % part.patchEdge;
        const uint32_t x = patch % part.patchesAcross() * part.patchEdge + column,
                       y = patch / part.patchesAcross() * part.patchEdge + row;
        const float byte = decodeBc4Texel(blocks + 8 * (x / 4 + size_t{width / 4} * (y / 4)), x % 4 + 4 * (y % 4));
        const MeshTexel texel = mixTexels(part, patch, static_cast<float>(column), static_cast<float>(row));
        if (map < 8) {
          const float value = entry["low"][map].get<float>() + entry["span"][map].get<float>() * byte / 255;
          EXPECT_NEAR(value, texel.features[map], 1e-5f);
        } else {
          EXPECT_NEAR(byte / 255, texel.opacity, 1e-6f);
        }
        EXPECT_NEAR(image.at(static_cast<int>(x), static_cast<int>(y))[0], byte, 0.5001);
      }
    }
  });
}

TEST_F(UnrealExportTest, WritesTheNumbersOfAllTexels) {
  for (const uint32_t level : {0u, 1u})
    expectMaps(kUnrealScene, level, exportedJson(kUnrealScene, level), root_ / "out");
}

TEST_F(UnrealExportTest, InfersMapsThatTheSceneDoesNotHold) {
  const MeshContent mesh = tiles_test::inferredMeshContent(3);
  const SceneFolderWriter writer(root_ / "scene");
  Tileset tileset;
  tileset.representation = kMeshName;
  tileset.geometricError = 10;
  const std::string uri = writer.addResource("encoder", "glb", encodeMeshEncoder(mesh.encoders[0]->encoder));
  tileset.resources = {{uri, kEncoderMimeType, 0}};
  Tile tile;
  tile.cells = tileset.allCells();
  tile.box = {Vec3d::Constant(-16), Vec3d::Constant(16)};
  TileContent content;
  content.cells = tile.cells;
  content.box = tile.box;
  content.resources = {0};
  content.uri = writer.addContent(0, "block", encodeMesh(mesh));
  tile.contents = {content};
  tileset.tiles = {tile};
  writer.commit(tileset);
  expectMaps(root_ / "scene", 0, exportedJson(root_ / "scene"), root_ / "out");
}

TEST_F(UnrealExportTest, PlacesTrianglesInUnrealsAxesAndCentimetres) {
  const nlohmann::json json = exportedJson();
  const Similarity tileFromScene = readTileset(kUnrealScene).tileFromScene();
  uint64_t triangles = 0;
  forEachPart(kUnrealScene, 0, json, [&](const nlohmann::json& entry, const PatchSet& part) {
    const Bytes file = readFile(root_ / "out" / entry["mesh"].get<std::string>());
    const auto glb = decodeGlb(file);
    ASSERT_TRUE(glb);
    const auto asset = nlohmann::json::parse(glb->json);
    const auto& node = asset["nodes"][asset["scenes"][0]["nodes"][0].get<size_t>()];
    for (const char* moved : {"matrix", "translation", "rotation", "scale"}) EXPECT_FALSE(node.contains(moved));
    const auto& primitive = asset["meshes"][0]["primitives"][0];
    const auto& view =
        asset["bufferViews"]
             [asset["accessors"][primitive["attributes"]["POSITION"].get<size_t>()]["bufferView"].get<size_t>()];
    std::vector<float> positions(view["byteLength"].get<size_t>() / sizeof(float));
    std::memcpy(positions.data(), glb->bytes.data() + view["byteOffset"].get<size_t>(), 4 * positions.size());
    ASSERT_EQ(positions.size(), size_t{12} * part.patches);
    for (uint32_t patch = 0; patch < part.patches; ++patch)
      for (uint32_t corner = 0; corner < 3; ++corner) {
        // Unreal's importer exchanges y and z, and multiplies by 100.
        const float* const at = &positions[size_t{12} * patch + size_t{3} * corner];
        Vec3d actual(100.0 * at[0], 100.0 * at[2], 100.0 * at[1]);
        for (size_t axis = 0; axis < 3; ++axis)
          actual[static_cast<Eigen::Index>(axis)] += entry["location"][axis].get<double>();
        const Vec3d inTile = tileFromScene * part.corner(patch, corner);
        const Vec3d expected(100 * inTile.x(), -100 * inTile.y(), 100 * inTile.z());
        ASSERT_LT((actual - expected).norm(), 1e-6 * (1 + expected.norm()));
      }
    EXPECT_EQ(entry["triangles"], part.triangles());
    triangles += part.triangles();
  });
  EXPECT_EQ(exported_.triangles, triangles);
}

TEST_F(UnrealExportTest, TurnsDirectionsBackIntoTheAxesOfTheScene) {
  const Similarity tileFromScene = readTileset(kUnrealScene).tileFromScene();
  ASSERT_GT((tileFromScene.rotation - Mat3d::Identity()).norm(), 0.1) << "the golden scene is turned";
  const Mat3d directions = sceneFromUnreal(tileFromScene);
  EXPECT_NEAR(directions.determinant(), -1, 1e-12) << "the handedness changes";
  for (const Vec3d& inScene : {Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0.48, -0.6, 0.64)}) {
    const Vec3d inTile = tileFromScene.rotation * inScene;
    EXPECT_LT((directions * Vec3d(inTile.x(), -inTile.y(), inTile.z()) - inScene).norm(), 1e-12);
  }
}

TEST_F(UnrealExportTest, NamesTheDecoderOfEachPartOnce) {
  const nlohmann::json json = exportedJson(kUnrealScene, 1);
  const Mat3d directions = sceneFromUnreal(readTileset(kUnrealScene).tileFromScene());
  EXPECT_EQ(json["decoders"].size(), exported_.decoders);
  forEachPart(kUnrealScene, 1, json, [&](const nlohmann::json& entry, const PatchSet& part) {
    const auto& decoder = json["decoders"][entry["decoder"].get<size_t>()];
    EXPECT_EQ(readTextFile(root_ / "out" / decoder["custom_node"].get<std::string>()),
              writeHlslStatements(part.decoder, directions));
    EXPECT_EQ(readTextFile(root_ / "out" / decoder["functions"].get<std::string>()),
              writeHlslFunctions(part.decoder, directions));
    const auto weights = nlohmann::json::parse(readTextFile(root_ / "out" / decoder["weights"].get<std::string>()));
    ASSERT_EQ(weights["layers"].size(), part.decoder.size());
    for (size_t i = 0; i < part.decoder.size(); ++i) {
      EXPECT_EQ(weights["layers"][i]["weights"].get<std::vector<float>>(), part.decoder[i].weights);
      EXPECT_EQ(weights["layers"][i]["biases"].get<std::vector<float>>(), part.decoder[i].biases);
    }
  });
  // A scene whose parts share their network.
  MeshContent mesh = tiles_test::randomMeshContent(4, 3);
  for (PatchSet& part : mesh.parts) part.decoder = mesh.parts[1].decoder;
  const SceneFolderWriter writer(root_ / "scene");
  Tileset tileset;
  tileset.representation = kMeshName;
  tileset.geometricError = 10;
  Tile tile;
  tile.box = {Vec3d::Constant(-16), Vec3d::Constant(16)};
  tile.contents.resize(1);
  tile.contents[0].box = tile.box;
  tile.contents[0].uri = writer.addContent(0, "block", encodeMesh(mesh));
  tileset.tiles = {tile};
  writer.commit(tileset);
  EXPECT_EQ(exportedJson(root_ / "scene")["parts"].size(), 3u);
  EXPECT_EQ(exported_.decoders, 1u);
}

TEST_F(UnrealExportTest, WritesNothingButTheFilesThatItNames) {
  const nlohmann::json json = exportedJson();
  std::set<std::string> expected = {"scene.json", "import_scene.py"};
  for (const auto& decoder : json["decoders"])
    for (const auto& file : decoder) expected.insert(file.get<std::string>());
  for (const auto& part : json["parts"]) {
    expected.insert(part["mesh"].get<std::string>());
    for (const char* kind : {"maps", "images"})
      for (const auto& file : part[kind]) expected.insert(file.get<std::string>());
  }
  std::set<std::string> actual;
  uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(root_ / "out")) {
    actual.insert(entry.path().filename().string());
    bytes += entry.file_size();
  }
  EXPECT_EQ(actual, expected);
  EXPECT_EQ(exported_.bytesOnDisk, bytes);
  EXPECT_EQ(json["georeference"]["latitude"], readTileset(kUnrealScene).georeference->latitude);
  exportedJson(kUnrealScene, 1);
  EXPECT_FALSE(fs::exists(root_ / "out" / "tile_1_0.glb")) << "replaces an older export";
}

TEST_F(UnrealExportTest, RefusesScenesOfOtherRepresentations) {
  try {
    exportUnreal(TESSERA_GOLDEN_VOLUME, root_ / "out");
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "is a scene of volume, which has no triangles");
    EXPECT_NE(error.remedy().find("--format unreal"), std::string::npos);
  }
  EXPECT_FALSE(fs::exists(root_ / "out"));
}

}  // namespace
}  // namespace tessera
