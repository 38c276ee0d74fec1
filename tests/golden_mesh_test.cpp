// Tests that the committed scene of `mesh` can be read, which a change of the format would break.
#include "golden/golden_mesh.h"

#include "golden_scene_test.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/cpu/mesh_drawer.h"

namespace tessera {
namespace {

const fs::path kMeshScene = TESSERA_GOLDEN_MESH;

TEST(GoldenMesh, MatchesTheExpectedSumsAndItsGenerator) {
  const nlohmann::ordered_json expected = readGoldenJson(kMeshScene / "sums.json");
  EXPECT_EQ(expected.size(), 5u);
  const golden::Scene<MeshContent> scene = golden::makeMeshScene();
  forEachGoldenContent<MeshContent>(
      kMeshScene, meshCodec(), [&](const auto& uri, const auto& name, const MeshContent& mesh) {
        const MeshContent& source = scene.contents.at(name);
        const auto& sums = expected.at(uri);
        EXPECT_EQ(mesh.isBackground, source.isBackground);
        EXPECT_EQ(mesh.skyEdge, source.skyEdge);
        EXPECT_EQ(mesh.sky, source.sky);
        ASSERT_EQ(mesh.parts.size(), sums.size());
        for (size_t i = 0; i < sums.size(); ++i) {
          EXPECT_EQ(golden::toJson(golden::computeSums(mesh.parts[i])), sums[i]) << uri << " part " << i;
          EXPECT_EQ(golden::toJson(golden::computeSums(source.parts[i])), sums[i]) << uri << " part " << i;
          EXPECT_EQ(mesh.parts[i].patchEdge, source.parts[i].patchEdge);
          EXPECT_EQ(mesh.parts[i].origin, source.parts[i].origin);
          EXPECT_EQ(mesh.parts[i].step, source.parts[i].step);
          EXPECT_EQ(mesh.parts[i].ranges, source.parts[i].ranges);
          EXPECT_TRUE(mesh.parts[i].decoder == source.parts[i].decoder);
        }
      });
}

TEST(GoldenMesh, HasSingleAndPairedPatchesAndBothPalettes) {
  for (const auto& [name, content] : golden::makeMeshScene().contents) {
    EXPECT_EQ(content.parts.size(), name == "all" ? 2u : 1u);
    EXPECT_EQ(content.skyEdge > 0, name == "background_block");
    for (const PatchSet& part : content.parts) {
      EXPECT_GT(part.pairs, 0u) << name;
      EXPECT_LT(part.pairs, part.patches) << name;
      int larger = 0, smaller = 0;
      for (size_t at = 0; at < part.opacityBlocks.size(); at += PatchSet::kBc4Bytes)
        ++(part.opacityBlocks[at] > part.opacityBlocks[at + 1] ? larger : smaller);
      EXPECT_GT(larger, 0) << name;
      EXPECT_GT(smaller, 0) << name;
    }
  }
}

// A camera of one pixel that looks along a ray.
struct RayCamera {
  Camera camera;
  Pose worldFromCamera;

  RayCamera(const TileFrame& frame, const SceneRay& ray) {
    camera.width = camera.height = 1;
    camera.lens = LensModel::pinhole;
    camera.parameters = {1, 1, 0.5, 0.5};
    Mat3d sceneFromCamera;
    sceneFromCamera.col(2) = ray.direction;
    sceneFromCamera.col(0) = ray.direction.unitOrthogonal();
    sceneFromCamera.col(1) = ray.direction.cross(sceneFromCamera.col(0));
    worldFromCamera.rotation = frame.rotation * sceneFromCamera;
    worldFromCamera.translation = frame.translation + frame.scale * (frame.rotation * ray.origin);
  }
};

TEST(GoldenMesh, RendersItsRaysAsTheDefinitionSays) {
  const TileScene scene = openTileScene(kMeshScene, meshCodec());
  const std::unique_ptr<CpuDrawer> drawer = makeMeshDrawer();
  std::vector<std::unique_ptr<Content>> contents;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i)
    contents.push_back(drawer->prepare(scene.source.load(static_cast<int>(i)), 1));
  const auto contentAt = [&](int tile) { return contents[static_cast<size_t>(tile)].get(); };
  const nlohmann::ordered_json rays = readGoldenJson(kMeshScene / "rays.json");
  EXPECT_EQ(rays.size(), 72u);
  ThreadPool pool(1);
  std::map<std::string, int> kinds;
  for (size_t i = 0; i < rays.size(); ++i) {
    const auto& ray = rays[i];
    const auto vector = [&](const char* key) { return Vec3d(ray.at(key).at(0), ray.at(key).at(1), ray.at(key).at(2)); };
    const SceneRay along{vector("origin"), vector("direction")};
    const int coarse = scene.tree.backgroundBlock, fine = scene.tree.tiles[static_cast<size_t>(coarse)].children.at(0);
    SceneView<Content> view;
    view.frame = scene.frame;
    view.backgroundBlock = contentAt(ray.at("level") == 1 ? coarse : fine);
    if (ray.at("level") == 1) {
      view.frontToBack.emplace_back(contentAt(0));
    } else {
      for (const int tile : scene.tree.childrenFrontToBack(0, along.origin))
        view.frontToBack.emplace_back(contentAt(tile));
    }
    const RayCamera eye(scene.frame, along);
    DrawSettings settings;
    settings.minTransmittance = 0;
    DrawCounts counts;
    const RenderedView seen = drawer->draw(view, {eye.camera, eye.worldFromCamera}, settings, pool, counts);
    const double opacity = ray.at("opacity"), distance = ray.at("distance");
    const Vec3d colour = vector("colour");
    for (size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(seen.colour.pixels[c], colour[static_cast<Eigen::Index>(c)], 1e-4) << "ray " << i;
    EXPECT_NEAR(seen.opacity.pixels[0], opacity, 1e-4) << "ray " << i;
    EXPECT_NEAR(seen.depth.pixels[0] / scene.frame.scale, distance, 1e-4 * (1 + distance)) << "ray " << i;
    ++kinds[opacity > 0.99 ? "opaque" : "open"];
    kinds["coarse"] += ray.at("level") == 1;
    kinds["far"] += distance > 6;
    kinds["layered"] += counts.samples >= 3;
    view.backgroundBlock = nullptr;
    const float left =
        1 - drawer->draw(view, {eye.camera, eye.worldFromCamera}, settings, pool, counts).opacity.pixels[0];
    kinds["blended"] += left > 0.05f && left < 0.95f;
  }
  EXPECT_GE(kinds["opaque"], 20);
  EXPECT_GE(kinds["open"], 4);
  EXPECT_GE(kinds["coarse"], 16);
  EXPECT_GE(kinds["far"], 10);
  EXPECT_GE(kinds["layered"], 20);
  EXPECT_GE(kinds["blended"], 5);
}

}  // namespace
}  // namespace tessera
