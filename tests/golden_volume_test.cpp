// The committed scene, read: what a change of the format would break.
#include "golden/golden_volume.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "render/cpu/draw_scene.h"
#include "render/tile_scene.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"
#include "tiles/volume_payload.h"

namespace tessera {
namespace {

const fs::path kScene = TESSERA_GOLDEN_VOLUME;

golden::VolumeSums sumsFrom(const nlohmann::json& json) {
  golden::VolumeSums sums;
  sums.stored = json.at("stored");
  sums.firstStored = json.at("firstStored");
  sums.occupied = json.at("occupied");
  sums.distances = json.at("distances");
  sums.voxels = json.at("voxels");
  sums.voxelsOrdered = json.at("voxelsOrdered");
  for (size_t axis = 0; axis < 3; ++axis) {
    sums.planes[axis] = json.at("planes").at(axis);
    sums.planesOrdered[axis] = json.at("planesOrdered").at(axis);
  }
  return sums;
}

// Name in the file's own name: tiles/L0/0_1-<digest>.glb.
std::string nameOfUri(const std::string& uri) {
  const std::string file = fs::path(uri).filename().string();
  return file.substr(0, file.find('-'));
}

void expectSame(const VolumeContent& a, const VolumeContent& b) {
  EXPECT_EQ(a.featureRange, b.featureRange);
  EXPECT_EQ(a.densityRange, b.densityRange);
  EXPECT_EQ(a.stepsPerTexel, b.stepsPerTexel);
  ASSERT_EQ(a.network.size(), b.network.size());
  for (size_t i = 0; i < a.network.size(); ++i) {
    EXPECT_EQ(a.network[i].inputs, b.network[i].inputs);
    EXPECT_EQ(a.network[i].outputs, b.network[i].outputs);
    EXPECT_EQ(a.network[i].weights, b.network[i].weights);
    EXPECT_EQ(a.network[i].biases, b.network[i].biases);
  }
  ASSERT_EQ(a.parts.size(), b.parts.size());
  for (size_t i = 0; i < a.parts.size(); ++i) {
    EXPECT_EQ(a.parts[i].centre, b.parts[i].centre);
    EXPECT_EQ(a.parts[i].scale, b.parts[i].scale);
    EXPECT_EQ(a.parts[i].low, b.parts[i].low);
    EXPECT_EQ(a.parts[i].high, b.parts[i].high);
    EXPECT_EQ(a.parts[i].contracted, b.parts[i].contracted);
    EXPECT_EQ(a.parts[i].surround, b.parts[i].surround);
    EXPECT_EQ(a.parts[i].voxels, b.parts[i].voxels);
    EXPECT_EQ(a.parts[i].planes, b.parts[i].planes);
    EXPECT_EQ(a.parts[i].macroblocks, b.parts[i].macroblocks);
    EXPECT_EQ(a.parts[i].voxelBytes, b.parts[i].voxelBytes);
    EXPECT_EQ(a.parts[i].planeBytes, b.parts[i].planeBytes);
    EXPECT_EQ(a.parts[i].distances, b.parts[i].distances);
  }
}

TEST(GoldenVolume, IsReadToTheExpectedSums) {
  const auto expected = nlohmann::json::parse(readTextFile(kScene / "sums.json"));
  const Tileset tileset = readTileset(kScene);
  size_t contents = 0;
  for (const Tile& tile : tileset.tiles) {
    for (const TileContent& content : tile.contents) {
      const VolumeContent volume = readContent<VolumeContent>(contentPath(kScene, content.uri));
      const auto& sums = expected.at(content.uri);
      ASSERT_EQ(volume.parts.size(), sums.size());
      for (size_t i = 0; i < sums.size(); ++i) {
        EXPECT_TRUE(golden::sumsOf(volume.parts[i]) == sumsFrom(sums[i])) << content.uri << " part " << i;
      }
      ++contents;
    }
  }
  EXPECT_EQ(contents, 5u);
  EXPECT_EQ(expected.size(), 5u);
}

TEST(GoldenVolume, HoldsWhatItWasMadeFrom) {
  const golden::Scene<VolumeContent> scene = golden::makeVolumeScene();
  const Tileset tileset = readTileset(kScene);
  EXPECT_EQ(tileset.worldFromScene.matrix(), scene.tileset.worldFromScene.matrix());
  EXPECT_EQ(tileset.sourceFromWorld, scene.tileset.sourceFromWorld);
  EXPECT_EQ(tileset.background, scene.tileset.background);
  EXPECT_EQ(tileset.georeference->latitude, scene.tileset.georeference->latitude);
  for (const Tile& tile : tileset.tiles) {
    for (const TileContent& content : tile.contents) {
      expectSame(readContent<VolumeContent>(contentPath(kScene, content.uri)),
                 scene.contents.at(nameOfUri(content.uri)));
    }
  }
}

TEST(GoldenVolume, IsTheSameWhenItIsWrittenAgain) {
  for (const Tile& tile : readTileset(kScene).tiles) {
    for (const TileContent& content : tile.contents) {
      const VolumeContent volume = readContent<VolumeContent>(contentPath(kScene, content.uri));
      std::string reason;
      const auto again = decodeVolume(encodeVolume(volume), reason);
      ASSERT_TRUE(again) << reason;
      expectSame(volume, *again);
    }
  }
}

// The oracle, which reckons in floats, against the definition.
TEST(GoldenVolume, LooksAlongItsRaysAsTheDefinitionSays) {
  const TileScene<VolumeContent> scene = openTileScene<VolumeContent>(kScene);
  std::vector<VolumeContent> contents;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) contents.push_back(scene.source.load(static_cast<int>(i)));
  const auto rays = nlohmann::json::parse(readTextFile(kScene / "rays.json"));
  EXPECT_EQ(rays.size(), 60u);
  std::map<std::string, int> kinds;
  for (size_t i = 0; i < rays.size(); ++i) {
    const auto& ray = rays[i];
    const auto vector = [&](const char* key) { return Vec3d(ray.at(key).at(0), ray.at(key).at(1), ray.at(key).at(2)); };
    const SceneRay along{vector("origin"), vector("direction")};
    const int coarse = scene.tree.surround, fine = scene.tree.tiles[coarse].children.at(0);
    SceneDrawing<VolumeContent> drawing{scene.frame, {}, &contents[ray.at("level") == 1 ? coarse : fine], {}};
    drawing.march.minTransmittance = 0;
    if (ray.at("level") == 1) {
      drawing.frontToBack = {&contents[0]};
    } else {
      for (const int tile : scene.tree.childrenFrontToBack(0, along.origin)) {
        drawing.frontToBack.push_back(&contents[tile]);
      }
    }
    MarchCounts counts;
    const DrawnPixel seen = RayCaster<VolumeContent>(drawing).cast(along, INFINITY, counts);
    const double opacity = ray.at("opacity"), distance = ray.at("distance");
    const Vec3d colour = vector("colour");
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen.colour[c], colour[c], 1e-4) << "ray " << i;
    EXPECT_NEAR(1 - seen.transmittance, opacity, 1e-4) << "ray " << i;
    EXPECT_NEAR(seen.depth, distance, 1e-4 * (1 + distance)) << "ray " << i;
    ++kinds[opacity > 0.99 ? "opaque" : "open"];
    kinds["coarse"] += ray.at("level") == 1;
    kinds["far"] += distance > 6;
    drawing.frontToBack.erase(drawing.frontToBack.begin() + 1, drawing.frontToBack.end());
    drawing.surround = nullptr;
    const float left = RayCaster<VolumeContent>(drawing).cast(along, INFINITY, counts).transmittance;
    kinds["blended"] += left > 0.05f && left < 0.95f;
  }
  EXPECT_GE(kinds["opaque"], 20);
  EXPECT_GE(kinds["open"], 4);
  EXPECT_GE(kinds["coarse"], 16);
  EXPECT_GE(kinds["far"], 10);
  EXPECT_GE(kinds["blended"], 5);
}

// Samples along a vertical line through a building: there is something, and it is where it should be.
TEST(GoldenVolume, HasOccupiedCellsAtItsRoofs) {
  const golden::Scene<VolumeContent> scene = golden::makeVolumeScene();
  const VolumePart& part = scene.contents.at("0_0").parts[0];
  const uint32_t cells = part.planes / VolumePart::kDistanceCell;
  const auto at = [&](double x, double y, double z) {  // local, in [-1,1]
    const auto cell = [&](double c) { return static_cast<size_t>((c + 1) / 2 * cells); };
    return part.distances[cell(x) + cells * (cell(y) + cells * cell(z))];
  };
  EXPECT_EQ(at(0, 0, 0.45), 0);
  EXPECT_GE(at(0, 0, 0.9), 1);
  EXPECT_GE(at(-0.8, 0.8, 0.9), 2);
  EXPECT_EQ(at(-0.8, 0.8, -0.45), 0);
}

}  // namespace
}  // namespace tessera
