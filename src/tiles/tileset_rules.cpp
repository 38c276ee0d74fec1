// The rules of a tileset, checked on writing and on reading (docs/tile-format.md, section 3).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "tiles/tileset.h"
#include "tiles/tileset_json.h"

namespace tessera {
namespace {

using Broken = std::optional<std::string>;

constexpr double kFarthestInScene = 1e7;
constexpr double kHighest = 16;  // of the scene's box, in scene units
constexpr uint32_t kMaxLevels = 64;
constexpr size_t kMaxNameLength = 64;  // of a representation's name

bool isRotation(const Mat3d& rotation) {
  return rotation.allFinite() && rotation.cwiseAbs().maxCoeff() < 2 &&
         (rotation.transpose() * rotation - Mat3d::Identity()).cwiseAbs().maxCoeff() < 1e-6 &&
         rotation.determinant() > 0;
}

bool isScale(double scale) {
  return scale > 1 / kFarthest && scale < kFarthest;  // also false for NaN
}

bool isAffine(const Mat4d& matrix) {
  return (matrix.array().abs() <= kFarthest).all() && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1);
}

bool isSimilarity(const Mat4d& matrix) {
  if (!isAffine(matrix)) return false;
  const Mat3d linear = matrix.topLeftCorner<3, 3>();
  const double scale = linear.col(0).norm();
  return isScale(scale) && isRotation(linear / scale);
}

bool isBox(const SceneBox& box) {
  return (box.low.array() >= -kFarthestInScene).all() && (box.high.array() <= kFarthestInScene).all() &&
         (box.low.array() < box.high.array()).all();
}

bool isError(double metres) {
  return metres >= 0 && metres <= kFarthest;
}

bool isRange(const CellRange& range) {
  return range.first[0] < range.end[0] && range.first[1] < range.end[1];
}

// Returns whether ranges lie on a grid: along each axis, any two are equal or disjoint, and no two are equal along
// both.
bool lieOnGrid(const std::vector<CellRange>& ranges) {
  for (size_t axis = 0; axis < 2; ++axis) {
    std::vector<std::pair<uint32_t, uint32_t>> sides;
    for (const CellRange& range : ranges) sides.emplace_back(range.first[axis], range.end[axis]);
    std::sort(sides.begin(), sides.end());
    for (size_t i = 1; i < sides.size(); ++i) {
      if (sides[i] != sides[i - 1] && sides[i].first < sides[i - 1].second) return false;
    }
  }
  std::set<std::array<uint32_t, 2>> corners;
  for (const CellRange& range : ranges) {
    if (!corners.insert(range.first).second) return false;
  }
  return true;
}

bool isName(std::string_view name) {
  const auto isPlain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_'; };
  return !name.empty() && name.size() <= kMaxNameLength && std::all_of(name.begin(), name.end(), isPlain);
}

Broken ruleOfResources(const Tileset& tileset) {
  std::set<std::string> seen;
  for (const SharedResource& resource : tileset.resources) {
    if (!isPlainUri(resource.uri)) return "the uri of a shared resource is not plain";
    if (!seen.insert(resource.uri).second) return "a shared resource is listed twice";
    if (resource.mimeType.empty() || resource.mimeType.size() > 127) return "a shared resource has no mimeType";
  }
  return std::nullopt;
}

Broken ruleOfExposureResponse(const Tileset& tileset) {
  constexpr float kMax = 16;  // stops, and stops per stop
  if (!tileset.exposureResponse) return std::nullopt;
  for (const auto& numbers : {tileset.exposureResponse->slope, tileset.exposureResponse->offset})
    for (const float number : numbers)
      if (!(std::abs(number) <= kMax)) return "the exposureResponse is out of bounds";
  return std::nullopt;
}

Broken ruleOfCoverage(const Tileset& tileset) {
  for (const SurfaceCoverage& part : tileset.coverage)
    if (part.holes > part.pixels) return "the coverage of a part counts more holes than pixels";
  return std::nullopt;
}

// Checks the background blocks of the root: finer ones must have smaller texels.
Broken ruleOfBackgroundBlocks(const Tileset& tileset) {
  std::map<uint32_t, double> errors;
  for (const TileContent& content : tileset.root().contents) {
    if (!content.backgroundBlock) continue;
    if (!content.box.contains(tileset.box())) return "the background block's box does not contain the scene's";
    if (content.level >= tileset.levels) return "a background block's level is not below the scene's number of levels";
    if (!isError(content.geometricError)) return "a background block's geometric error is not a length";
    if (!errors.emplace(content.level, content.geometricError).second)
      return "two background blocks have the same level";
  }
  double finer = 0;
  for (const auto& [level, error] : errors) {
    if (error < finer) return "a background block's geometric error is below a finer one's";
    finer = error;
  }
  return std::nullopt;
}

Broken ruleOfContents(const Tileset& tileset, const Tile& tile, bool isRoot) {
  for (const TileContent& content : tile.contents) {
    if (!isPlainUri(content.uri) || !content.uri.ends_with(".glb"))
      return "a content's uri is not the plain name of a .glb file";
    if (!isBox(content.box)) return "a content's box is empty or out of bounds";
    std::set<uint32_t> resources;
    for (const uint32_t resource : content.resources) {
      if (resource >= tileset.resources.size()) return "a content needs a shared resource that is not listed";
      if (!resources.insert(resource).second) return "a content needs a shared resource twice";
    }
    if (content.backgroundBlock) {
      if (!isRoot) return "a background block is not in the root";
      continue;
    }
    if (!tile.box.contains(content.box)) return "a content's box is not within its tile's";
    if (!isRange(content.cells) || !tile.cells.contains(content.cells))
      return "a content's cells are not within its tile's";
  }
  return isRoot ? ruleOfBackgroundBlocks(tileset) : std::nullopt;
}

// Returns whether the tile stays within the inner walls of its cells; at the border of the grid it may own what lies
// outside.
bool keepsToCells(const Tileset& tileset, const Tile& tile) {
  const SceneBox walls = tileset.boxFromCells(tile.cells);
  const std::array<uint32_t, 2> counts = {tileset.columns, tileset.rows};
  for (size_t axis = 0; axis < 2; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    if (tile.cells.first[axis] > 0 && tile.box.low[a] < walls.low[a]) return false;
    if (tile.cells.end[axis] < counts[axis] && tile.box.high[a] > walls.high[a]) return false;
  }
  return true;
}

Broken ruleOfTile(const Tileset& tileset, const Tile& tile) {
  if (tile.level >= tileset.levels) return "its level is not below the scene's number of levels";
  if (!isRange(tile.cells) || !tileset.allCells().contains(tile.cells)) return "its cells are not within the grid";
  if (!isBox(tile.box)) return "its box is empty or out of bounds";
  if (!isError(tile.geometricError)) return "its geometric error is not a length";
  return ruleOfContents(tileset, tile, &tile == &tileset.root());
}

Broken ruleOfChildren(const Tileset& tileset, const Tile& tile) {
  std::vector<CellRange> ranges;
  uint64_t cells = 0;
  for (const uint32_t index : tile.children) {
    const Tile& child = tileset.tiles[index];
    if (child.level >= tile.level) return "a child is not of a finer level";
    if (!tile.cells.contains(child.cells)) return "a child's cells are not within its own";
    if (!tile.box.contains(child.box)) return "a child's box is not within its own";
    if (child.geometricError > tile.geometricError) return "a child's geometric error is above its own";
    ranges.push_back(child.cells);
    cells += child.cells.cells();
  }
  if (!lieOnGrid(ranges)) return "its children do not lie on a grid";
  if (!tile.children.empty() && cells != tile.cells.cells()) return "its children do not cover its cells";
  return std::nullopt;
}

// Returns whether each tile except the root is the child of exactly one earlier tile.
bool isTree(const Tileset& tileset) {
  std::vector<bool> hasParent(tileset.tiles.size());
  hasParent[0] = true;
  for (size_t i = 0; i < tileset.tiles.size(); ++i) {
    for (const uint32_t child : tileset.tiles[i].children) {
      if (child <= i || child >= tileset.tiles.size() || hasParent[child]) return false;
      hasParent[child] = true;
    }
  }
  return std::find(hasParent.begin(), hasParent.end(), false) == hasParent.end();
}

}  // namespace

std::optional<uint32_t> tileWithoutOrder(const Tileset& tileset) {
  for (size_t i = 0; i < tileset.tiles.size(); ++i) {
    std::vector<CellRange> ranges;
    for (const TileContent& content : tileset.tiles[i].contents) {
      if (!content.backgroundBlock) ranges.push_back(content.cells);
    }
    if (!lieOnGrid(ranges)) return static_cast<uint32_t>(i);
  }
  return std::nullopt;
}

std::optional<uint32_t> tileBeyondItsCells(const Tileset& tileset) {
  for (size_t i = 0; i < tileset.tiles.size(); ++i)
    if (!keepsToCells(tileset, tileset.tiles[i])) return static_cast<uint32_t>(i);
  return std::nullopt;
}

std::optional<std::string> frameError(const Tileset& tileset) {
  if (!isRotation(tileset.worldFromScene.rotation)) return "worldFromScene's rotation is not a rotation";
  if (!isScale(tileset.worldFromScene.scale)) return "worldFromScene's scale is not above zero";
  if (!isPlace(tileset.worldFromScene.translation)) return "worldFromScene's translation is out of bounds";
  if (!isAffine(tileset.sourceFromWorld)) return "sourceFromWorld is not affine";
  if (tileset.columns < 1 || tileset.columns > kMaxCells || tileset.rows < 1 || tileset.rows > kMaxCells) {
    return "the grid's columns or rows are out of bounds";
  }
  if (!(tileset.bottom >= -kHighest && tileset.bottom < tileset.top && tileset.top <= kHighest)) {
    return "the grid's heights are not within -16 and 16";
  }
  if (!(tileset.near >= 0 && tileset.near <= 1)) return "near is not between 0 and 1";
  for (const float channel : tileset.background) {
    if (!(channel >= 0 && channel <= 1)) return "the background is not a colour";
  }
  if (const auto& geo = tileset.georeference) {
    if (!(std::abs(geo->latitude) <= 90 && std::abs(geo->longitude) <= 180 && std::abs(geo->altitude) <= 1e5)) {
      return "the georeference is not a place on the Earth";
    }
    if (!isSimilarity(geo->enuFromWorld)) return "the georeference's enuFromWorld is not a similarity";
  }
  return std::nullopt;
}

std::optional<std::string> validationError(const Tileset& tileset) {
  if (tileset.tiles.empty()) return "there are no tiles";
  if (tileset.levels < 1 || tileset.levels > kMaxLevels) return "the number of levels is out of bounds";
  if (!isName(tileset.representation)) return "the representation's name is not valid";
  if (auto broken = frameError(tileset)) return broken;
  if (auto broken = ruleOfResources(tileset)) return broken;
  if (auto broken = ruleOfCoverage(tileset)) return broken;
  if (auto broken = ruleOfExposureResponse(tileset)) return broken;
  if (!(tileset.geometricError >= tileset.root().geometricError && tileset.geometricError <= kFarthest)) {
    return "the tileset's geometric error is below its root's";
  }
  if (!(tileset.root().cells == tileset.allCells())) return "the root does not cover all cells";
  if (!isTree(tileset)) return "the tiles are not a tree";
  for (const auto checkRule : {ruleOfTile, ruleOfChildren}) {
    for (size_t i = 0; i < tileset.tiles.size(); ++i) {
      if (const auto broken = checkRule(tileset, tileset.tiles[i])) return fmt::format("tile {}: {}", i, *broken);
    }
  }
  return std::nullopt;
}

}  // namespace tessera
