// For tests: a small tileset that satisfies every rule of the format.
#pragma once

#include <string>

#include "tiles/tileset.h"

namespace tessera::tiles_test {

// A tileset of `columns` × 2 cells, each a leaf below one root, with two background blocks.
inline Tileset testTileset(uint32_t columns = 3, bool georeferenced = true) {
  Tileset tileset;
  tileset.representation = "volume";
  tileset.name = "made";
  tileset.worldFromScene.rotation << 0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1;
  tileset.worldFromScene.scale = 12.5;
  tileset.worldFromScene.translation = {3, -4, 1.75};
  tileset.sourceFromWorld.topRightCorner<3, 1>() = Vec3d(1, 2, 3);
  if (georeferenced) {
    tileset.georeference = GeoFrame{50.82, -0.14, 31.5, Mat4d::Identity()};
    tileset.georeference->enuFromWorld.topLeftCorner<3, 3>() =
        1.25 * Eigen::AngleAxisd(0.3, Vec3d::UnitZ()).toRotationMatrix();
    tileset.georeference->enuFromWorld.topRightCorner<3, 1>() = Vec3d(-7, 8, 0.1);
  }
  tileset.columns = columns;
  tileset.rows = 2;
  tileset.bottom = -0.25;
  tileset.top = 0.75;
  tileset.background = {0.25f, 0.5f, 0.75f};
  tileset.levels = 2;
  tileset.geometricError = 100;
  tileset.resources = {{"resources/table-0a.bin", "application/octet-stream", 17}};
  Tile root;
  root.level = 1;
  root.cells = tileset.allCells();
  root.box = tileset.box();
  root.geometricError = 0.5;
  const SceneBox far = {Vec3d::Constant(-1000), Vec3d::Constant(1000)};
  root.contents.push_back({"tiles/L1/all-00.glb", root.cells, root.box, false, {0}, 1234});
  root.contents.push_back({"tiles/L1/background_block-00.glb", root.cells, far, true, {}, 0, 1, 3.5});
  root.contents.push_back({"tiles/L0/background_block-00.glb", root.cells, far, true, {}, 0, 0, 1.75});
  tileset.tiles.push_back(root);
  for (uint32_t j = 0; j < tileset.rows; ++j) {
    for (uint32_t i = 0; i < columns; ++i) {
      Tile tile;
      tile.cells = {{i, j}, {i + 1, j + 1}};
      tile.box = tileset.boxFromCells(tile.cells);
      tile.box.high.z() = 0.5;
      tile.geometricError = 0.25;
      tile.contents.resize(1);
      tile.contents[0].uri = "tiles/L0/" + std::to_string(i) + "_" + std::to_string(j) + "-00.glb";
      tile.contents[0].cells = tile.cells;
      tile.contents[0].box = tile.box;
      tileset.tiles[0].children.push_back(static_cast<uint32_t>(tileset.tiles.size()));
      tileset.tiles.push_back(std::move(tile));
    }
  }
  return tileset;
}

}  // namespace tessera::tiles_test
