#include "tiles/tileset.h"

#include <GeographicLib/Geocentric.hpp>
#include <algorithm>
#include <cstdlib>

#include "base/check.h"

namespace tessera {

Mat4d Similarity::matrix() const {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() = scale * rotation;
  matrix.topRightCorner<3, 1>() = translation;
  return matrix;
}

bool CellRange::contains(const CellRange& other) const {
  return first[0] <= other.first[0] && first[1] <= other.first[1] && other.end[0] <= end[0] && other.end[1] <= end[1];
}

bool Tile::hasContents() const {
  return std::any_of(contents.begin(), contents.end(), [](const auto& one) { return !one.backgroundBlock; });
}

bool Tile::isDrawable() const {
  return children.empty() || hasContents();
}

SceneBox Tileset::box() const {
  return boxFromCells(allCells());
}

SceneBox Tileset::boxFromCells(const CellRange& cells) const {
  const auto wall = [](uint32_t index, uint32_t count) { return 2.0 * index - count; };
  return {{wall(cells.first[0], columns), wall(cells.first[1], rows), bottom},
          {wall(cells.end[0], columns), wall(cells.end[1], rows), top}};
}

BlockGrid Tileset::blockGrid() const {
  BlockGrid grid;
  grid.originInWorld = worldFromScene.translation;
  grid.gridFromWorld = worldFromScene.rotation.transpose();
  grid.edge = 2 * worldFromScene.scale;
  grid.columns = static_cast<int>(columns);
  grid.rows = static_cast<int>(rows);
  grid.bottom = bottom * worldFromScene.scale;
  grid.top = top * worldFromScene.scale;
  return grid;
}

void placeOn(Tileset& tileset, const BlockGrid& grid) {
  CHECK(grid.columns >= 1);
  CHECK(grid.rows >= 1);
  const Vec3d middle(0, 0, (grid.bottom + grid.top) / 2);
  tileset.worldFromScene = {grid.gridFromWorld.transpose(), grid.edge / 2, grid.inWorld(middle)};
  tileset.columns = static_cast<uint32_t>(grid.columns);
  tileset.rows = static_cast<uint32_t>(grid.rows);
  tileset.top = (grid.top - grid.bottom) / grid.edge;
  tileset.bottom = -tileset.top;
}

Similarity Tileset::tileFromScene() const {
  if (!georeference) return worldFromScene;
  const Mat3d linear = georeference->enuFromWorld.topLeftCorner<3, 3>();
  const double scale = std::cbrt(linear.determinant());
  return {linear / scale * worldFromScene.rotation, scale * worldFromScene.scale,
          linear * worldFromScene.translation + georeference->enuFromWorld.topRightCorner<3, 1>()};
}

Mat4d Tileset::rootTransform() const {
  Mat4d ecefFromTile = Mat4d::Identity();
  if (!georeference) return ecefFromTile;
  std::vector<double> rotation(9);  // row-major
  Vec3d origin;
  GeographicLib::Geocentric::WGS84().Forward(georeference->latitude, georeference->longitude, georeference->altitude,
                                             origin.x(), origin.y(), origin.z(), rotation);
  ecefFromTile.topLeftCorner<3, 3>() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.data());
  ecefFromTile.topRightCorner<3, 1>() = origin;
  return ecefFromTile;
}

std::array<uint32_t, 2> Tileset::cellAt(const Vec3d& xInScene) const {
  const auto index = [](double x, uint32_t count) {
    return static_cast<uint32_t>(std::clamp(std::floor(0.5 * (x + count)), 0.0, count - 1.0));
  };
  return {index(xInScene.x(), columns), index(xInScene.y(), rows)};
}

uint32_t cellsBetween(const std::array<uint32_t, 2>& cell, const CellRange& range) {
  uint32_t cells = 0;
  for (size_t axis = 0; axis < 2; ++axis) {
    if (cell[axis] < range.first[axis]) cells += range.first[axis] - cell[axis];
    if (cell[axis] >= range.end[axis]) cells += cell[axis] - range.end[axis] + 1;
  }
  return cells;
}

std::vector<uint32_t> childrenFrontToBack(const Tileset& tileset, uint32_t tile, const Vec3d& xInScene) {
  const auto cell = tileset.cellAt(xInScene);
  std::vector<uint32_t> order = tileset.tiles[tile].children;
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return cellsBetween(cell, tileset.tiles[a].cells) < cellsBetween(cell, tileset.tiles[b].cells);
  });
  return order;
}

std::vector<uint32_t> coarsestCover(const Tileset& tileset) {
  std::vector<uint32_t> cover, waiting = {0};
  for (size_t i = 0; i < waiting.size(); ++i) {
    const Tile& tile = tileset.tiles[waiting[i]];
    if (tile.isDrawable()) {
      cover.push_back(waiting[i]);
    } else {
      waiting.insert(waiting.end(), tile.children.begin(), tile.children.end());
    }
  }
  return cover;
}

bool showsOutside(const Tileset& tileset) {
  SceneBox near = tileset.box();
  near.low -= Vec3d::Constant(2);
  near.high += Vec3d::Constant(2);
  for (const Tile& tile : tileset.tiles) {
    for (const TileContent& content : tile.contents) {
      if (content.backgroundBlock || !near.contains(content.box)) return true;
    }
  }
  return false;
}

uint32_t coarsestLevel(const Tileset& tileset) {
  uint32_t level = 0;
  for (const Tile& tile : tileset.tiles) {
    if (tile.hasContents()) level = std::max(level, tile.level);
  }
  return level;
}

}  // namespace tessera
