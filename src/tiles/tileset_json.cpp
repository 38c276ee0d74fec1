#include "tiles/tileset_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/check.h"
#include "base/error.h"
#include "scene/surface_coverage_json.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

template <class Derived>
std::vector<double> flattened(const Eigen::MatrixBase<Derived>& matrix) {  // column-major
  std::vector<double> numbers;
  for (Eigen::Index c = 0; c < matrix.cols(); ++c) {
    for (Eigen::Index r = 0; r < matrix.rows(); ++r) numbers.push_back(matrix(r, c));
  }
  return numbers;
}

Json cellsToJson(const CellRange& range) {
  return {range.first[0], range.first[1], range.end[0], range.end[1]};
}

void addBox(Json& object, const SceneBox& box) {
  object["low"] = flattened(box.low);
  object["high"] = flattened(box.high);
}

Json boundsToJson(const Tileset& tileset, const SceneBox& box) {
  return {{"box", boundingBoxNumbers(tileset, box)}};
}

Json contentToJson(const Tileset& tileset, const Tile& tile, const TileContent& content) {
  Json ours = Json::object();
  if (content.backgroundBlock) {
    ours["background_block"] = true;
    ours["level"] = content.level;
    ours["geometricError"] = content.geometricError;
  } else if (!(content.cells == tile.cells)) {
    ours["cells"] = cellsToJson(content.cells);
  }
  addBox(ours, content.box);
  if (!content.resources.empty()) ours["resources"] = content.resources;
  if (content.bytes > 0) ours["bytes"] = content.bytes;
  return {{"uri", content.uri},
          {"boundingVolume", boundsToJson(tileset, content.box)},
          {"extensions", {{kSceneExtension, std::move(ours)}}}};
}

// The recursion is bounded, because levels decrease from parent to child.
Json tileToJson(const Tileset& tileset, const Tile& tile, bool isRoot) {
  Json json;
  if (isRoot && tileset.georeference) json["transform"] = flattened(tileset.rootTransform());
  json["boundingVolume"] = boundsToJson(tileset, enclosingBox(tile));
  json["geometricError"] = tile.geometricError;
  if (isRoot) json["refine"] = "REPLACE";
  Json contents = Json::array();
  for (const TileContent& content : tile.contents) contents.push_back(contentToJson(tileset, tile, content));
  if (contents.size() == 1) {
    json["content"] = std::move(contents[0]);
  } else if (!contents.empty()) {
    json["contents"] = std::move(contents);
  }
  Json& ours = json["extensions"][kSceneExtension];
  ours = {{"level", tile.level}, {"cells", cellsToJson(tile.cells)}};
  addBox(ours, tile.box);
  for (const uint32_t child : tile.children)
    json["children"].push_back(tileToJson(tileset, tileset.tiles[child], false));
  return json;
}

Json sceneToJson(const Tileset& tileset) {
  Json scene = {{"version", kSceneVersion},
                {"representation", tileset.representation},
                {"name", tileset.name},
                {"worldFromScene",
                 {{"rotation", flattened(tileset.worldFromScene.rotation)},
                  {"scale", tileset.worldFromScene.scale},
                  {"translation", flattened(tileset.worldFromScene.translation)}}},
                {"sourceFromWorld", flattened(tileset.sourceFromWorld)},
                {"grid", {{"columns", tileset.columns}, {"rows", tileset.rows}}},
                {"near", tileset.near},
                {"background", tileset.background},
                {"levels", tileset.levels}};
  addBox(scene["grid"], tileset.box());
  if (const auto& geo = tileset.georeference) {
    scene["georeference"] = {{"latitude", geo->latitude},
                             {"longitude", geo->longitude},
                             {"altitude", geo->altitude},
                             {"enuFromWorld", flattened(geo->enuFromWorld)}};
  }
  for (const SharedResource& resource : tileset.resources) {
    Json entry = {{"uri", resource.uri}, {"mimeType", resource.mimeType}};
    if (resource.bytes > 0) entry["bytes"] = resource.bytes;
    scene["resources"].push_back(std::move(entry));
  }
  if (!tileset.coverage.empty()) scene["coverage"] = coverageToJson(tileset.coverage);
  if (const auto& response = tileset.exposureResponse)
    scene["exposureResponse"] = {{"slope", response->slope}, {"offset", response->offset}};
  return scene;
}

Error tooLarge(const std::string& why) {
  return {"tileset.json", "", why, "train with fewer --blocks"};
}

}  // namespace

void requireWritable(const Tileset& tileset) {
  if (!(tileset.near >= 0 && tileset.near <= 1)) {
    throw Error("tileset.json", fmt::format("near={}", tileset.near), "is not between 0 and 1, in halves of a block",
                "train with --set near=0.05, or another that is");
  }
  if (tileset.columns > kMaxCells || tileset.rows > kMaxCells) {
    throw tooLarge(fmt::format("would have {} by {} blocks, and at most {} fit along a side", tileset.columns,
                               tileset.rows, kMaxCells));
  }
  if (const TilesetLimits limits; tileset.tiles.size() > limits.tiles) {
    throw tooLarge(fmt::format("would have {} tiles, and readers take {} at most", tileset.tiles.size(), limits.tiles));
  }
}

SceneBox enclosingBox(const Tile& tile) {
  SceneBox box = tile.box;
  for (const TileContent& content : tile.contents) {
    box.low = box.low.cwiseMin(content.box.low);
    box.high = box.high.cwiseMax(content.box.high);
  }
  return box;
}

std::array<double, 12> boundingBoxNumbers(const Tileset& tileset, const SceneBox& box) {
  const Similarity tileFromScene = tileset.tileFromScene();
  const Vec3d centre = tileFromScene * (0.5 * (box.low + box.high));
  const Mat3d halfAxes = tileFromScene.scale * tileFromScene.rotation * (0.5 * (box.high - box.low)).asDiagonal();
  std::array<double, 12> numbers;
  std::copy(centre.data(), centre.data() + 3, numbers.begin());
  std::copy(halfAxes.data(), halfAxes.data() + 9, numbers.begin() + 3);
  return numbers;
}

std::string encodeTileset(const Tileset& tileset) {
  requireWritable(tileset);
  const auto broken = validationError(tileset);
  CHECK(broken.value_or("") == "");
  const Json file = {{"asset", {{"version", "1.1"}, {"generator", "tessera"}}},
                     {"extensionsUsed", {kSceneExtension}},
                     {"extensions", {{kSceneExtension, sceneToJson(tileset)}}},
                     {"geometricError", tileset.geometricError},
                     {"root", tileToJson(tileset, tileset.root(), true)}};
  std::string text = file.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
  if (const TilesetLimits limits; text.size() > limits.textBytes) {
    throw tooLarge(fmt::format("takes {} bytes, and readers take {} at most", text.size(), limits.textBytes));
  }
  return text;
}

bool isPlainUri(std::string_view uri) {
  if (uri.empty() || uri.size() > 255) return false;
  bool startsPart = true;
  for (const char c : uri) {
    const bool isName = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    if (startsPart && (c == '.' || c == '/')) return false;
    if (!isName && c != '.' && c != '_' && c != '-' && c != '/') return false;
    startsPart = c == '/';
  }
  return !startsPart;
}

}  // namespace tessera
