#include "export/gltf.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "export/mesh_level.h"
#include "scene/axes.h"
#include "tiles/glb.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

const fs::path kGoldenMesh = TESSERA_GOLDEN_MESH, kGoldenVolume = TESSERA_GOLDEN_VOLUME;

class GltfExportTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("tessera-gltf-" + std::to_string(::getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  // Returns a copy of the golden scene that a test may damage.
  fs::path copyGolden() const {
    fs::copy(kGoldenMesh, root_ / "scene", fs::copy_options::recursive);
    return root_ / "scene";
  }

  fs::path root_;
};

// An asset as a program reads it.
struct ReadAsset {
  nlohmann::json json;
  Bytes bytes;

  explicit ReadAsset(const fs::path& file) {
    const Bytes all = readFile(file);
    const auto glb = decodeGlb(all);
    if (!glb) throw std::runtime_error("is no glTF");
    json = nlohmann::json::parse(glb->json);
    bytes.assign(glb->bytes.begin(), glb->bytes.end());
  }

  template <class T>
  std::vector<T> read(const nlohmann::json& accessor) const {
    const auto& view = json["bufferViews"][accessor["bufferView"].get<size_t>()];
    std::vector<T> values(view["byteLength"].get<size_t>() / sizeof(T));
    std::memcpy(values.data(), bytes.data() + view["byteOffset"].get<size_t>(), values.size() * sizeof(T));
    return values;
  }

  // Returns the corners of all triangles in the axes of glTF, by the names of nodes.
  std::map<std::string, std::vector<Vec3d>> corners() const {
    std::map<std::string, std::vector<Vec3d>> all;
    const auto& root = json["nodes"][json["scenes"][0]["nodes"][0].get<size_t>()];
    Mat4d matrix;
    for (int i = 0; i < 16; ++i) matrix(i % 4, i / 4) = root["matrix"][static_cast<size_t>(i)].get<double>();
    for (const auto& child : root["children"]) {
      const auto& node = json["nodes"][child.get<size_t>()];
      const auto& primitive = json["meshes"][node["mesh"].get<size_t>()]["primitives"][0];
      const auto positions = read<float>(json["accessors"][primitive["attributes"]["POSITION"].get<size_t>()]);
      const auto& moved = node["translation"];
      for (const uint32_t corner : read<uint32_t>(json["accessors"][primitive["indices"].get<size_t>()])) {
        Vec3d at;
        for (size_t axis = 0; axis < 3; ++axis)
          at[static_cast<Eigen::Index>(axis)] = moved[axis].get<double>() + double{positions[3 * corner + axis]};
        all[node["name"]].push_back((matrix * at.homogeneous()).head<3>());
      }
    }
    return all;
  }
};

// Returns the corners of the triangles of a level as the tile format defines them, in the axes of glTF.
std::map<std::string, std::vector<Vec3d>> expectedCorners(uint32_t level) {
  const MeshLevel scene(kGoldenMesh, level, "gltf");
  const Similarity tileFromScene = scene.tileset().tileFromScene();
  std::map<std::string, std::vector<Vec3d>> all;
  for (const LevelContent& listed : scene.contents()) {
    const auto content = scene.read(listed);
    const MeshContent& mesh = contentAs<MeshContent>(*content);
    for (size_t i = 0; i < mesh.parts.size(); ++i) {
      const PatchSet& part = mesh.parts[i];
      std::vector<Vec3d>& corners = all[partName(listed, mesh, i)];
      const auto add = [&](uint32_t patch, uint32_t corner) {
        const Vec3d at = tileFromScene * part.corner(patch, corner);
        corners.emplace_back(at.x(), at.z(), -at.y());
      };
      for (uint32_t patch = 0; patch < part.patches; ++patch) {
        for (const uint32_t corner : {0u, 1u, 2u}) add(patch, corner);
        if (patch >= part.pairs) continue;
        for (const uint32_t corner : {3u, 2u, 1u}) add(patch, corner);
      }
    }
  }
  return all;
}

void expectEqual(const std::map<std::string, std::vector<Vec3d>>& actual,
                 const std::map<std::string, std::vector<Vec3d>>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (const auto& [name, corners] : expected) {
    ASSERT_TRUE(actual.contains(name)) << name;
    ASSERT_EQ(actual.at(name).size(), corners.size()) << name;
    for (size_t i = 0; i < corners.size(); ++i)
      ASSERT_LT((actual.at(name)[i] - corners[i]).norm(), 1e-6 * (1 + corners[i].norm())) << name << " " << i;
  }
}

TEST_F(GltfExportTest, PlacesTheTrianglesOfALevelInMetresWithYUp) {
  for (const uint32_t level : {0u, 1u}) {
    const GltfExport exported = exportGltf(kGoldenMesh, root_ / "a.glb", {.level = level});
    const auto corners = ReadAsset(root_ / "a.glb").corners();
    expectEqual(corners, expectedCorners(level));
    uint64_t triangles = 0;
    for (const auto& [name, each] : corners) triangles += each.size() / 3;
    EXPECT_EQ(exported.triangles, triangles);
    EXPECT_EQ(exported.bytesOnDisk, fs::file_size(root_ / "a.glb"));
    EXPECT_EQ(exported.tiles, level == 0 ? 3u : 2u) << "with the background block";
  }
}

TEST_F(GltfExportTest, HasBoundsWithoutCornersThatNoTriangleHas) {
  exportGltf(kGoldenMesh, root_ / "a.glb");
  const ReadAsset asset(root_ / "a.glb");
  for (const auto& mesh : asset.json["meshes"]) {
    const auto& primitive = mesh["primitives"][0];
    const auto& accessor = asset.json["accessors"][primitive["attributes"]["POSITION"].get<size_t>()];
    const auto positions = asset.read<float>(accessor);
    const auto indices = asset.read<uint32_t>(asset.json["accessors"][primitive["indices"].get<size_t>()]);
    for (size_t axis = 0; axis < 3; ++axis) {
      float low = INFINITY, high = -INFINITY;
      for (const uint32_t corner : indices) {
        low = std::min(low, positions[3 * corner + axis]);
        high = std::max(high, positions[3 * corner + axis]);
      }
      EXPECT_EQ(accessor["min"][axis].get<float>(), low);
      EXPECT_EQ(accessor["max"][axis].get<float>(), high);
    }
  }
}

TEST_F(GltfExportTest, EmbedsTheTexturesOfTheScene) {
  exportGltf(kGoldenMesh, root_ / "a.glb");
  const ReadAsset asset(root_ / "a.glb");
  const MeshLevel scene(kGoldenMesh, 0, "gltf");
  size_t image = 0;
  for (const LevelContent& listed : scene.contents()) {
    const auto content = scene.read(listed);
    for (const Bytes& texture : scene.readBaseColours(listed, contentAs<MeshContent>(*content))) {
      ASSERT_LT(image, asset.json["images"].size());
      EXPECT_EQ(asset.read<std::byte>(asset.json["images"][image++]), texture);
    }
  }
  EXPECT_EQ(image, asset.json["images"].size());
  EXPECT_EQ(asset.json["materials"].size(), image);
}

TEST_F(GltfExportTest, SaysWhereOnEarthTheOriginIs) {
  exportGltf(kGoldenMesh, root_ / "a.glb", {.level = 1});
  const auto extras = ReadAsset(root_ / "a.glb").json["scenes"][0]["extras"]["tessera"];
  EXPECT_EQ(extras["level"], 1);
  const auto georeference = readTileset(kGoldenMesh).georeference;
  ASSERT_TRUE(georeference);
  EXPECT_EQ(extras["georeference"]["latitude"], georeference->latitude);
  EXPECT_EQ(extras["georeference"]["longitude"], georeference->longitude);
  EXPECT_EQ(extras["georeference"]["altitude"], georeference->altitude);
}

TEST_F(GltfExportTest, WritesOneFileForEachTileOnRequest) {
  const GltfExport exported = exportGltf(kGoldenMesh, root_ / "tiles", {.isSplit = true});
  std::map<std::string, std::vector<Vec3d>> corners;
  std::set<std::string> names;
  uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(root_ / "tiles")) {
    names.insert(entry.path().filename().string());
    bytes += entry.file_size();
    corners.merge(ReadAsset(entry.path()).corners());
  }
  EXPECT_EQ(names, (std::set<std::string>{"background_block.glb", "tile_0_0.glb", "tile_1_0.glb"}));
  EXPECT_EQ(exported.files, names.size());
  EXPECT_EQ(exported.bytesOnDisk, bytes);
  expectEqual(corners, expectedCorners(0));
  EXPECT_NO_THROW(exportGltf(kGoldenMesh, root_ / "tiles", {.level = 1, .isSplit = true})) << "replaces an older one";
  EXPECT_FALSE(fs::exists(root_ / "tiles" / "tile_1_0.glb"));
}

// Returns the message of the error that an export throws.
std::string refusal(const fs::path& scene, const fs::path& out, const GltfExportSettings& settings = {}) {
  try {
    exportGltf(scene, out, settings);
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST_F(GltfExportTest, RefusesWhatItCannotExportAndWritesNothing) {
  const auto expectRefusal = [&](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  };
  expectRefusal(refusal(kGoldenVolume, root_ / "a.glb"), "is a scene of volume, which has no triangles");
  expectRefusal(refusal(kGoldenMesh, root_ / "a.glb", {.level = 2}), "the scene has levels 0 to 1");
  expectRefusal(refusal(kGoldenMesh, root_ / "a.gltf"), "ends in .glb");
  writeFileAtomically(root_ / "model" / "blocks.json", "{}");
  expectRefusal(refusal(root_ / "model", root_ / "a.glb"), "run tessera bake");
  const fs::path scene = copyGolden();
  for (const auto& entry : fs::directory_iterator(scene / "resources"))
    if (entry.path().filename().string().starts_with("1_0")) writeFileAtomically(entry.path(), "damaged");
  expectRefusal(refusal(scene, root_ / "a.glb"), "is not the undamaged PNG");
  EXPECT_FALSE(fs::exists(root_ / "a.glb"));
  for (const auto& entry : fs::directory_iterator(root_))
    EXPECT_EQ(entry.path().string().find("partial"), std::string::npos) << entry.path();
}

}  // namespace
}  // namespace tessera
