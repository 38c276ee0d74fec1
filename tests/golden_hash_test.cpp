// The committed scene of `hash`, read: what a change of the format would break.
#include "golden/golden_hash.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "render/cpu/draw_scene.h"
#include "render/tile_scene.h"
#include "tiles/hash_payload.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

const fs::path kScene = TESSERA_GOLDEN_HASH;

golden::HashSums sumsFrom(const nlohmann::json& json) {
  golden::HashSums sums;
  sums.stored = json.at("stored");
  sums.firstStored = json.at("firstStored");
  sums.occupied = json.at("occupied");
  sums.distances = json.at("distances");
  sums.corners = json.at("corners");
  sums.cornersOrdered = json.at("cornersOrdered");
  sums.tables = json.at("tables").get<std::vector<uint64_t>>();
  sums.tablesOrdered = json.at("tablesOrdered").get<std::vector<uint64_t>>();
  return sums;
}

// Name in the file's own name: tiles/L0/0_1-<digest>.glb.
std::string nameOfUri(const std::string& uri) {
  const std::string file = fs::path(uri).filename().string();
  return file.substr(0, file.find('-'));
}

TEST(GoldenHash, IsReadToTheExpectedSumsAndHoldsWhatItWasMadeFrom) {
  const auto expected = nlohmann::json::parse(readTextFile(kScene / "sums.json"));
  const golden::Scene<HashContent> scene = golden::makeHashScene();
  size_t contents = 0;
  for (const Tile& tile : readTileset(kScene).tiles) {
    for (const TileContent& content : tile.contents) {
      const HashContent hash = readContent<HashContent>(contentPath(kScene, content.uri));
      const HashContent& made = scene.contents.at(nameOfUri(content.uri));
      const auto& sums = expected.at(content.uri);
      ASSERT_EQ(hash.parts.size(), sums.size());
      EXPECT_EQ(hash.weights, made.weights);
      EXPECT_EQ(hash.logits, made.logits);
      EXPECT_EQ(hash.step, made.step);
      for (size_t l = 0; l < made.network.size(); ++l) EXPECT_EQ(hash.network[l].weights, made.network[l].weights);
      for (size_t i = 0; i < sums.size(); ++i) {
        EXPECT_TRUE(golden::sumsOf(hash.parts[i]) == sumsFrom(sums[i])) << content.uri << " part " << i;
        EXPECT_TRUE(golden::sumsOf(hash.parts[i]) == golden::sumsOf(made.parts[i])) << content.uri << " part " << i;
        EXPECT_EQ(hash.parts[i].ranges, made.parts[i].ranges);
      }
      ++contents;
    }
  }
  EXPECT_EQ(contents, 5u);
  EXPECT_EQ(expected.size(), 5u);
}

// The oracle, which reckons in floats, against the definition.
TEST(GoldenHash, LooksAlongItsRaysAsTheDefinitionSays) {
  const TileScene<HashContent> scene = openTileScene<HashContent>(kScene);
  std::vector<HashContent> contents;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) contents.push_back(scene.source.load(static_cast<int>(i)));
  const auto rays = nlohmann::json::parse(readTextFile(kScene / "rays.json"));
  EXPECT_EQ(rays.size(), 60u);
  std::map<std::string, int> kinds;
  for (size_t i = 0; i < rays.size(); ++i) {
    const auto& ray = rays[i];
    const auto vector = [&](const char* key) { return Vec3d(ray.at(key).at(0), ray.at(key).at(1), ray.at(key).at(2)); };
    const SceneRay along{vector("origin"), vector("direction")};
    const int coarse = scene.tree.surround, fine = scene.tree.tiles[static_cast<size_t>(coarse)].children.at(0);
    SceneDrawing<HashContent> drawing{
        scene.frame, {}, &contents[static_cast<size_t>(ray.at("level") == 1 ? coarse : fine)], {}};
    drawing.march.minTransmittance = 0;
    if (ray.at("level") == 1) {
      drawing.frontToBack = {&contents[0]};
    } else {
      for (const int tile : scene.tree.childrenFrontToBack(0, along.origin)) {
        drawing.frontToBack.push_back(&contents[static_cast<size_t>(tile)]);
      }
    }
    MarchCounts counts;
    const DrawnPixel seen = RayCaster<HashContent>(drawing).cast(along, INFINITY, counts);
    const double opacity = ray.at("opacity"), distance = ray.at("distance");
    const Vec3d colour = vector("colour");
    for (size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(seen.colour[c], colour[static_cast<Eigen::Index>(c)], 1e-4) << "ray " << i;
    EXPECT_NEAR(1 - seen.transmittance, opacity, 1e-4) << "ray " << i;
    EXPECT_NEAR(seen.depth, distance, 1e-4 * (1 + distance)) << "ray " << i;
    ++kinds[opacity > 0.99 ? "opaque" : "open"];
    kinds["coarse"] += ray.at("level") == 1;
    kinds["far"] += distance > 6;
    drawing.frontToBack.erase(drawing.frontToBack.begin() + 1, drawing.frontToBack.end());
    drawing.surround = nullptr;
    const float left = RayCaster<HashContent>(drawing).cast(along, INFINITY, counts).transmittance;
    kinds["blended"] += left > 0.05f && left < 0.95f;
  }
  EXPECT_GE(kinds["opaque"], 20);
  EXPECT_GE(kinds["open"], 4);
  EXPECT_GE(kinds["coarse"], 16);
  EXPECT_GE(kinds["far"], 10);
  EXPECT_GE(kinds["blended"], 5);
}

}  // namespace
}  // namespace tessera
