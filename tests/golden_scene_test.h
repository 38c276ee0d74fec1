// What the tests of the committed scenes share, for all representations.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "raymarch/cpu/draw_scene.h"
#include "render/tile_scene.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {

inline nlohmann::ordered_json readGoldenJson(const fs::path& file) {
  return nlohmann::ordered_json::parse(readTextFile(file));
}

// Calls `use` with each content of a scene, its uri, and its name in the generator (tiles/L0/<name>-<digest>.glb).
template <class Content_>
void forEachGoldenContent(
    const fs::path& scene, const ContentCodec& codec,
    const std::function<void(const std::string& uri, const std::string& name, const Content_& content)>& use) {
  size_t contents = 0;
  for (const Tile& tile : readTileset(scene).tiles) {
    for (const TileContent& content : tile.contents) {
      const std::string file = fs::path(content.uri).filename().string();
      use(content.uri, file.substr(0, file.find('-')),
          contentAs<Content_>(*readContent(contentPath(scene, content.uri), codec)));
      ++contents;
    }
  }
  EXPECT_EQ(contents, 5u);
}

// Tests the CPU oracle, which computes in floats, against the definition.
template <class Content_>
void expectRaysAsDefined(const fs::path& folder, const ContentCodec& codec) {
  const TileScene scene = openTileScene(folder, codec);
  std::vector<Content_> contents;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    contents.push_back(contentAs<Content_>(*scene.source.load(static_cast<int>(i))));
  }
  const nlohmann::ordered_json rays = readGoldenJson(folder / "rays.json");
  EXPECT_EQ(rays.size(), 60u);
  std::map<std::string, int> kinds;
  for (size_t i = 0; i < rays.size(); ++i) {
    const auto& ray = rays[i];
    const auto vector = [&](const char* key) { return Vec3d(ray.at(key).at(0), ray.at(key).at(1), ray.at(key).at(2)); };
    const SceneRay along{vector("origin"), vector("direction")};
    const int coarse = scene.tree.backgroundBlock, fine = scene.tree.tiles[static_cast<size_t>(coarse)].children.at(0);
    SceneDrawing<Content_> drawing{
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
    const DrawnPixel seen = RayCaster<Content_>(drawing).cast(along, INFINITY, counts);
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
    drawing.backgroundBlock = nullptr;
    const float left = RayCaster<Content_>(drawing).cast(along, INFINITY, counts).transmittance;
    kinds["blended"] += left > 0.05f && left < 0.95f;
  }
  EXPECT_GE(kinds["opaque"], 20);
  EXPECT_GE(kinds["open"], 4);
  EXPECT_GE(kinds["coarse"], 16);
  EXPECT_GE(kinds["far"], 10);
  EXPECT_GE(kinds["blended"], 5);
}

}  // namespace tessera
