#include "representations/mesh/bake/mesh_baker.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/image_io.h"
#include "render/cpu/scene_renderer.h"
#include "render/tile_scene.h"
#include "representations/mesh/content/infer_maps.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/cpu/mesh_drawer.h"
#include "representations/mesh/testing/cube_training.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/mesh/train/mesh_renderer.h"
#include "representations/mesh/train/train_mesh.h"
#include "tiles/glb.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"
#include "train/testing/cube_scene.h"

namespace tessera {
namespace {

// A cube in front of walls, trained for a moment in 2 × 1 blocks that contain the walls, once for all tests.
class BakeMeshScene : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    CubeScene::Options enclosed;
    enclosed.isEnclosed = true;
    cube_ = std::make_unique<CubeScene>(enclosed);
    device_ = makeDevice({"cpu", 2});
    TrainMeshOptions options;
    options.config = smallMeshConfig();
    options.config.meshCells = 16;
    options.config.meshLevels = 2;
    options.blocks = {false, 2, 1};
    options.loop.steps = 300;
    options.loop.progress = false;
    options.loop.checkpointSeconds = 1e6;
    ASSERT_TRUE(trainMesh(*device_, cube_->capture(), model(), options).finished);
  }
  static void TearDownTestSuite() {
    cube_.reset();
    device_.reset();
  }

  static fs::path model() { return *cube_ / "model"; }
  static BakedScene bake(const std::string& name, const MeshSceneSettings& settings, Device& device = *device_) {
    const auto baker = makeMeshBaker(StoredMesh(device, model()), settings);
    return bakeScene(*baker, cube_->capture(), *cube_ / name, {});
  }
  static std::unique_ptr<SceneRenderer> open(const std::string& name, int finestLevel = 0) {
    TileScene scene = openTileScene(*cube_ / name, meshCodec());
    SceneRendererSettings settings;
    settings.selection.finestLevel = finestLevel;
    settings.threads = 2;
    return std::make_unique<SceneRenderer>(makeMeshDrawer(), scene.frame, std::move(scene.tree),
                                           std::move(scene.source), settings);
  }
  // PSNR between two renderers over the test photos.
  static double compare(ViewRenderer& a, ViewRenderer& b) {
    double squares = 0, numbers = 0;
    for (const int index : cube_->capture().photosIn(Split::test)) {
      const Photo& photo = cube_->capture().photos[index];
      const Camera& camera = cube_->capture().cameras[photo.camera];
      const ImageF one = compositeOver(a.render(camera, photo.worldFromCamera), {0, 0, 0}),
                   other = compositeOver(b.render(camera, photo.worldFromCamera), {0, 0, 0});
      for (size_t i = 0; i < one.pixels.size(); ++i, ++numbers) squares += std::pow(one.pixels[i] - other.pixels[i], 2);
    }
    return -10 * std::log10(squares / numbers);
  }

  static std::unique_ptr<CubeScene> cube_;
  static std::unique_ptr<Device> device_;
};
std::unique_ptr<CubeScene> BakeMeshScene::cube_;
std::unique_ptr<Device> BakeMeshScene::device_;

TEST_F(BakeMeshScene, LooksAsTheModelAtItsFinestLevel) {
  const BakedScene baked = bake("scene", {.patchEdge = 12, .tilesPerBlock = 2});
  EXPECT_EQ(baked.tileset.columns, 4u);
  EXPECT_EQ(baked.tileset.rows, 2u);
  ASSERT_EQ(baked.levels.size(), 2u);
  TrainedMesh mesh = loadTrainedMesh(*device_, model());
  MeshRenderer renderer(mesh);
  const auto fine = open("scene"), coarse = open("scene", 1);
  const double psnr = compare(*fine, renderer);
  EXPECT_GT(psnr, 22) << "a wrong place of any part gives less than 15";
  EXPECT_LT(compare(*coarse, renderer), psnr) << "the coarsest level has less detail";
  EXPECT_EQ(baked.levels[0].counts[0].first, "triangles");
  EXPECT_LT(baked.levels[1].counts[0].second, baked.levels[0].counts[0].second);
  EXPECT_EQ(baked.tileset.coverage.size(), 2u);
  EXPECT_EQ(baked.tileset.coverage, readMeshCoverage(model()));
}

TEST_F(BakeMeshScene, GivesTheSameBytesAgainAndTheSameImageFromOtherTiles) {
  bake("one", {.tilesPerBlock = 1});
  const std::unique_ptr<Device> oneThread = makeDevice({"cpu", 1});
  bake("again", {.tilesPerBlock = 1}, *oneThread);
  bake("pieces", {.tilesPerBlock = 4});
  EXPECT_EQ(readTextFile(*cube_ / "one" / "tileset.json"), readTextFile(*cube_ / "again" / "tileset.json"))
      << "names contain digests of the files";
  const auto one = open("one"), pieces = open("pieces");
  EXPECT_GT(compare(*one, *pieces), 50) << "the same patches in other tiles";
}

TEST_F(BakeMeshScene, HasPatchesInTheOrderOfTheirSurfaces) {
  const BakedScene baked = bake("in_order", {.tilesPerBlock = 1, .fallback = false});
  size_t pairs = 0, neighbours = 0;
  for (const Tile& tile : baked.tileset.tiles)
    for (const TileContent& listed : tile.contents) {
      const auto content = readContent(contentPath(*cube_ / "in_order", listed.uri), meshCodec());
      for (const PatchSet& part : contentAs<MeshContent>(*content).parts)
        for (uint32_t patch = 1; patch < part.pairs; ++patch, ++pairs) {
          bool hasCommonCorner = false;
          for (uint32_t number = 0; number < 16; ++number)
            hasCommonCorner = hasCommonCorner || part.corner(patch, number / 4) == part.corner(patch - 1, number % 4);
          neighbours += hasCommonCorner ? 1 : 0;
        }
    }
  EXPECT_GT(pairs, 500u);
  EXPECT_GT(neighbours, pairs / 2) << "patches that follow one another have a corner in common";
}

TEST_F(BakeMeshScene, ContainsOrdinaryMeshesWithTexturesThatExist) {
  const BakedScene baked = bake("ordinary", {});
  std::set<std::string> textures;
  size_t meshes = 0;
  for (const Tile& tile : baked.tileset.tiles) {
    for (const TileContent& content : tile.contents) {
      const Bytes file = readFile(contentPath(*cube_ / "ordinary", content.uri));
      const auto glb = decodeGlb(file);
      ASSERT_TRUE(glb);
      const nlohmann::json asset = nlohmann::json::parse(glb->json);
      if (!asset.contains("meshes")) continue;
      meshes += asset["meshes"].size();
      for (const auto& image : asset["images"]) {
        const fs::path path =
            *cube_ / "ordinary" / fs::path(content.uri).parent_path() / image["uri"].get<std::string>();
        const auto info = probeImage(readFile(path));
        ASSERT_TRUE(info) << path;
        textures.insert(fs::canonical(path).string());
      }
      for (const auto& accessor : asset["accessors"]) EXPECT_GT(accessor["count"].get<int>(), 0);
      EXPECT_TRUE(content.resources.empty()) << "viewers need not fetch textures";
    }
  }
  EXPECT_GE(meshes, 3u);
  EXPECT_EQ(textures.size(), baked.tileset.resources.size());
  bake("without", {.fallback = false});
  EXPECT_FALSE(fs::exists(*cube_ / "without" / "resources"));
}

TEST_F(BakeMeshScene, HasACoarseBackgroundBlockWithTheSameTriangles) {
  const CubeScene scene;     // without walls, so that photos show what is outside of the region
  TrainMeshOptions options;  // the walls are outside of the block
  options.config = smallMeshConfig();
  options.config.coarseSteps = 400;
  options.config.backgroundShare = 0.9;
  options.grid = cubeGrid();
  options.loop.steps = 300;
  options.loop.progress = false;
  options.loop.checkpointSeconds = 1e6;
  ASSERT_TRUE(trainMesh(*device_, cube_->capture(), *cube_ / "cube_alone", options).finished);
  const auto baker = makeMeshBaker(StoredMesh(*device_, *cube_ / "cube_alone"), {.patchEdge = 12});
  const BakedScene baked = bakeScene(*baker, cube_->capture(), *cube_ / "background", {});
  std::map<uint32_t, std::unique_ptr<Content>> contents;  // of background blocks, by level
  std::map<uint32_t, TileContent> listed;
  for (const TileContent& each : baked.tileset.root().contents) {
    if (!each.backgroundBlock) continue;
    listed[each.level] = each;
    contents[each.level] = readContent(contentPath(*cube_ / "background", each.uri), meshCodec());
  }
  ASSERT_EQ(contents.size(), 2u);
  EXPECT_GT(listed[1].geometricError, listed[0].geometricError);
  const MeshContent &fine = contentAs<MeshContent>(*contents[0]), &coarse = contentAs<MeshContent>(*contents[1]);
  EXPECT_GT(fine.triangles(), 20u);
  EXPECT_LT(contents[1]->memoryBytes() - fine.sky.size(), (contents[0]->memoryBytes() - fine.sky.size()) / 2);
  EXPECT_EQ(coarse.sky, fine.sky);
  ASSERT_EQ(coarse.parts.size(), fine.parts.size());
  double same = 0, other = 0;  // differences of numbers in the middle of equal patches, and of patches that follow
  for (size_t i = 0; i < fine.parts.size(); ++i) {
    const PatchSet &a = fine.parts[i], &b = coarse.parts[i];
    EXPECT_EQ(b.patchEdge, 4u);
    ASSERT_EQ(b.vertices, a.vertices);
    for (uint32_t patch = 0; patch + 1 < a.pairs; ++patch) {
      const MeshTexel one = mixTexels(a, patch, 5.5, 5.5), two = mixTexels(b, patch, 1.5, 1.5),
                      next = mixTexels(b, patch + 1, 1.5, 1.5);
      for (size_t f = 0; f < kMeshFeatures; ++f) {
        same += std::abs(one.features[f] - two.features[f]);
        other += std::abs(one.features[f] - next.features[f]);
      }
    }
  }
  EXPECT_LT(same, other / 2);
  const Bytes file = readFile(contentPath(*cube_ / "background", listed[1].uri));
  EXPECT_FALSE(nlohmann::json::parse(decodeGlb(file)->json).contains("meshes")) << "other programs show both";
}

TEST_F(BakeMeshScene, InfersTheTexturesThatItWouldStore) {
  const BakedScene stored = bake("stored", {.tilesPerBlock = 2, .fallback = false}),
                   inferred = bake("inferred", {.tilesPerBlock = 2, .fallback = false, .inferredMaps = true});
  ASSERT_EQ(inferred.tileset.resources.size(), 2u) << "one encoder of each block";
  ASSERT_EQ(inferred.tileset.tiles.size(), stored.tileset.tiles.size());
  const auto read = [&](const std::string& scene, const Tileset& tileset, const TileContent& content) {
    Resources resources;
    for (const uint32_t number : content.resources) {
      const SharedResource& resource = tileset.resources[number];
      resources.push_back(readResource(contentPath(*cube_ / scene, resource.uri), meshCodec(), resource));
    }
    return readContent(contentPath(*cube_ / scene, content.uri), meshCodec(), resources);
  };
  size_t parts = 0;
  for (size_t tile = 0; tile < stored.tileset.tiles.size(); ++tile) {
    const auto &contents = stored.tileset.tiles[tile].contents, &others = inferred.tileset.tiles[tile].contents;
    ASSERT_EQ(contents.size(), others.size());
    for (size_t i = 0; i < contents.size(); ++i) {
      const auto one = read("stored", stored.tileset, contents[i]),
                 other = read("inferred", inferred.tileset, others[i]);
      EXPECT_EQ(one->memoryBytes(), other->memoryBytes());
      const MeshContent& content = contentAs<MeshContent>(*one);
      MeshContent mesh = contentAs<MeshContent>(*other);
      ASSERT_EQ(content.parts.size(), mesh.parts.size());
      for (size_t number = 0; number < mesh.parts.size(); ++number) {
        PatchSet& part = mesh.parts[number];
        EXPECT_FALSE(content.parts[number].encoder);
        if (part.encoder) {
          const std::unique_ptr<Device> device = makeDevice({"cpu", 1});
          MapInference(*device, mesh.encoders[part.encoder->resource]->encoder).infer(part);
          ++parts;
        }
        EXPECT_EQ(part.featureBlocks, content.parts[number].featureBlocks) << contents[i].uri;
        EXPECT_EQ(part.opacityBlocks, content.parts[number].opacityBlocks) << contents[i].uri;
      }
    }
  }
  EXPECT_GE(parts, 8u) << "the tiles of the finest level";
  for (const int level : {0, 1}) {
    const auto one = open("stored", level), other = open("inferred", level);
    for (const int index : cube_->capture().photosIn(Split::test)) {
      const Photo& photo = cube_->capture().photos[index];
      const Camera& camera = cube_->capture().cameras[photo.camera];
      const RenderedView a = one->render(camera, photo.worldFromCamera, nullptr),
                         b = other->render(camera, photo.worldFromCamera, nullptr);
      EXPECT_EQ(a.colour.pixels, b.colour.pixels);
      EXPECT_EQ(a.opacity.pixels, b.opacity.pixels);
      EXPECT_EQ(a.depth.pixels, b.depth.pixels);
    }
  }
}

TEST_F(BakeMeshScene, ExtractsTheTrianglesOfModelsWithoutAFinalStage) {
  const CubeScene scene;  // without walls
  TrainMeshOptions options;
  options.config = smallMeshConfig();
  options.config.backgroundBlock = "none";
  options.config.finalShare = 0;
  options.config.coarseSteps = 300;
  options.blocks = {false, 2, 1};
  options.loop.steps = 300;
  options.loop.progress = false;
  options.loop.checkpointSeconds = 1e6;
  ASSERT_TRUE(trainMesh(*device_, scene.capture(), scene / "model", options).finished);
  const auto bakePlain = [&](const std::string& name, bool inferred) {
    const auto baker =
        makeMeshBaker(StoredMesh(*device_, scene / "model"), {.fallback = false, .inferredMaps = inferred});
    return bakeScene(*baker, scene.capture(), *cube_ / name, {});
  };
  const BakedScene stored = bakePlain("plain_stored", false), inferred = bakePlain("plain_inferred", true);
  ASSERT_EQ(stored.levels.size(), 2u);
  EXPECT_TRUE(stored.tileset.coverage.empty());
  EXPECT_EQ(inferred.tileset.resources.size(), 2u);
  EXPECT_LT(stored.levels[1].counts[0].second, stored.levels[0].counts[0].second);
  TrainedMesh mesh = loadTrainedMesh(*device_, scene / "model");
  MeshRenderer renderer(mesh);
  for (const int level : {0, 1}) {
    const auto one = open("plain_stored", level), other = open("plain_inferred", level);
    EXPECT_GT(compare(*one, renderer), level == 0 ? 22 : 17);
    EXPECT_GT(heldOutPsnr(scene, *one), level == 0 ? 18 : 15);
    EXPECT_GT(compare(*one, *other), 90) << "the same textures";
  }
}

TEST_F(BakeMeshScene, MayHaveCoarserTexelsThanTheTraining) {
  TrainMeshOptions options;
  options.config = smallMeshConfig();
  options.config.backgroundBlock = "none";
  options.config.patchTexels = 16;
  options.blocks = {false, 1, 1};
  options.loop.steps = 40;
  options.loop.progress = false;
  options.loop.checkpointSeconds = 1e6;
  const fs::path folder = *cube_ / "fine_texels";
  ASSERT_TRUE(trainMesh(*device_, cube_->capture(), folder, options).finished);
  const auto baker = makeMeshBaker(StoredMesh(*device_, folder), {.patchEdge = 8, .fallback = false});
  const BakedScene baked = bakeScene(*baker, cube_->capture(), *cube_ / "coarse_texels", {});
  ASSERT_EQ(baked.tileset.tiles.size(), 2u);
  EXPECT_NO_THROW(open("coarse_texels"));
}

// The same model is baked with and without its views.
TEST_F(BakeMeshScene, HasTrianglesThatOnlyViewsBetweenPhotosShow) {
  const CubeScene scene({.isEnclosed = true, .photos = 16});
  TrainMeshOptions options;
  options.config = smallMeshConfig();
  options.config.finalShare = 0;
  options.config.enoughPhotos = 40;
  options.config.coarseSteps = 120;
  options.blocks = {false, 1, 1};
  options.loop.steps = 100;
  options.loop.progress = false;
  options.loop.checkpointSeconds = 1e6;
  ASSERT_TRUE(trainMesh(*device_, scene.capture(), scene / "model", options).finished);
  const auto countTriangles = [&](const std::string& name) {
    const auto baker = makeMeshBaker(StoredMesh(*device_, scene / "model"), {.fallback = false});
    return bakeScene(*baker, scene.capture(), *cube_ / name, {}).levels[0].counts[0].second;
  };
  const auto withViews = countTriangles("with_views");
  fs::remove_all(scene / "model" / "views");
  EXPECT_GT(withViews, countTriangles("without_views"));
}

TEST_F(BakeMeshScene, IsRefusedBeforeBakingIfItHasTooManyTiles) {
  TrainMeshOptions options;
  options.config = smallMeshConfig();
  options.config.backgroundBlock = "none";
  options.config.finalShare = 0;
  options.config.coarseSteps = 4;
  options.blocks = {false, 9, 9};
  options.only = {"coarse", "block_4_4"};
  options.loop.steps = 4;
  options.loop.progress = false;
  const fs::path folder = *cube_ / "many_blocks";
  ASSERT_TRUE(trainMesh(*device_, cube_->capture(), folder, options).finished);
  EXPECT_NO_THROW(makeMeshBaker(StoredMesh(*device_, folder), {.tilesPerBlock = 4}));
  try {
    makeMeshBaker(StoredMesh(*device_, folder), {.tilesPerBlock = 8});
    FAIL() << "72 x 72 tiles are more than 5000";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("--tiles-per-block 8"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("72 x 72 tiles"), std::string::npos) << error.what();
  }
}

TEST_F(BakeMeshScene, IsNotDrawnWithoutItsEncoders) {
  const BakedScene baked = bake("without_encoders", {.fallback = false, .inferredMaps = true});
  const fs::path encoder = contentPath(*cube_ / "without_encoders", baked.tileset.resources[0].uri);
  const Photo& photo = cube_->capture().photos[0];
  const auto draw = [&] {
    open("without_encoders")->render(cube_->capture().cameras[photo.camera], photo.worldFromCamera, nullptr);
  };
  draw();
  writeFileAtomically(encoder, Bytes(100));
  EXPECT_THROW(draw(), Error);
  fs::remove(encoder);
  EXPECT_THROW(draw(), Error);
}

}  // namespace
}  // namespace tessera
