// tileset.json, read: untrusted text.
#include <fmt/format.h>

#include <deque>

#include "tiles/json_fields.h"
#include "tiles/tileset_json.h"

namespace tessera {
namespace {

using namespace json_fields;

const json* oursOf(const json& object) {
  const json* extensions = fieldOf(object, "extensions");
  return extensions ? fieldOf(*extensions, kSceneExtension) : nullptr;
}

std::optional<Vec3d> vectorOf(const json& object, const char* key) {
  const auto numbers = numbersOf<3>(object, key);
  return numbers ? std::optional<Vec3d>(Vec3d(numbers->data())) : std::nullopt;
}

std::optional<Mat4d> matrixOf(const json& object, const char* key) {
  const auto numbers = numbersOf<16>(object, key);
  return numbers ? std::optional<Mat4d>(Mat4d(numbers->data())) : std::nullopt;
}

std::optional<SceneBox> boxOf(const json& object) {
  const auto low = vectorOf(object, "low"), high = vectorOf(object, "high");
  return low && high ? std::optional<SceneBox>(SceneBox{*low, *high}) : std::nullopt;
}

std::optional<CellRange> cellsOf(const json& object) {
  const json* cells = arrayOf(object, "cells");
  if (!cells || cells->size() != 4) return std::nullopt;
  uint32_t numbers[4];
  for (size_t i = 0; i < 4; ++i) {
    const auto number = unsignedFrom((*cells)[i], UINT32_MAX);
    if (!number) return std::nullopt;
    numbers[i] = static_cast<uint32_t>(*number);
  }
  return CellRange{{numbers[0], numbers[1]}, {numbers[2], numbers[3]}};
}

// Sizes are hints; one that is no number is none.
uint64_t bytesOf(const json& object) {
  const json* field = fieldOf(object, "bytes");
  return field ? unsignedFrom(*field, uint64_t{1} << 53).value_or(0) : 0;
}

class TilesetReader {
 public:
  TilesetReader(std::string& reason, const TilesetLimits& limits) : reason_(reason), limits_(limits) {}

  std::optional<Tileset> read(const json& file) {
    if (!readAsset(file) || !readScene(*oursOf(file)) || !readResources(*oursOf(file))) return std::nullopt;
    const auto error = numberOf(file, "geometricError");
    const json* root = fieldOf(file, "root");
    if (!error || !root || !readTree(*root)) {
      fail("has no geometricError or no root");
      return std::nullopt;
    }
    tileset_.geometricError = *error;
    if (auto broken = brokenRule(tileset_)) {
      fail(*broken);
      return std::nullopt;
    }
    for (size_t i = 0; i < sources_.size(); ++i) {
      if (!agreesWithBoxes(i)) return std::nullopt;
    }
    return std::move(tileset_);
  }

 private:
  bool fail(const std::string& reason) {
    if (reason_.empty()) reason_ = reason;  // the first is the one to mend
    return false;
  }

  bool readAsset(const json& file) {
    const json* asset = fieldOf(file, "asset");
    if (!asset || !isString(*asset, "version", "1.1")) return fail("is not 3D Tiles 1.1");
    if (const json* required = fieldOf(file, "extensionsRequired"); required && !required->empty()) {
      return fail("requires extensions that are not known");
    }
    const json* ours = oursOf(file);
    if (!ours) return fail("has no extension TESSERA_scene");
    const auto version = unsignedOf(*ours, "version");
    if (!version) return fail("does not say which version it is of");
    if (*version != kSceneVersion) return fail(fmt::format("is of version {}; {} is known", *version, kSceneVersion));
    return true;
  }

  bool readScene(const json& ours) {
    const std::string* representation = stringOf(ours, "representation");
    if (!representation) return fail("does not name its representation");
    tileset_.representation = *representation;
    if (const std::string* name = stringOf(ours, "name")) tileset_.name = *name;
    const json* placement = fieldOf(ours, "worldFromScene");
    if (!placement) return fail("has no worldFromScene");
    const auto rotation = numbersOf<9>(*placement, "rotation");
    const auto scale = numberOf(*placement, "scale");
    const auto translation = vectorOf(*placement, "translation");
    const auto source = matrixOf(ours, "sourceFromWorld");
    if (!rotation || !scale || !translation || !source) return fail("worldFromScene or sourceFromWorld lacks numbers");
    tileset_.worldFromScene = {Mat3d(rotation->data()), *scale, *translation};
    tileset_.sourceFromWorld = *source;
    return readGeoreference(ours) && readGrid(ours);
  }

  bool readGeoreference(const json& ours) {
    const json* geo = fieldOf(ours, "georeference");
    if (!geo) return true;
    const auto latitude = numberOf(*geo, "latitude"), longitude = numberOf(*geo, "longitude");
    const auto altitude = numberOf(*geo, "altitude");
    const auto enuFromWorld = matrixOf(*geo, "enuFromWorld");
    if (!latitude || !longitude || !altitude || !enuFromWorld) return fail("the georeference lacks numbers");
    tileset_.georeference = GeoFrame{*latitude, *longitude, *altitude, *enuFromWorld};
    return true;
  }

  bool readGrid(const json& ours) {
    const json* grid = fieldOf(ours, "grid");
    if (!grid) return fail("has no grid");
    const auto columns = unsignedOf(*grid, "columns"), rows = unsignedOf(*grid, "rows");
    const auto box = boxOf(*grid);
    const auto levels = unsignedOf(ours, "levels");
    const auto near = numberOf(ours, "near");
    const auto background = numbersOf<3>(ours, "background");
    if (!columns || !rows || !box || !levels || !near || !background) {
      return fail("the grid, levels, near or background is not complete");
    }
    tileset_.columns = *columns;
    tileset_.rows = *rows;
    tileset_.bottom = box->low.z();
    tileset_.top = box->high.z();
    tileset_.levels = *levels;
    tileset_.near = *near;
    for (size_t i = 0; i < 3; ++i) tileset_.background[i] = static_cast<float>((*background)[i]);
    const SceneBox expected = tileset_.box();
    if (expected.low != box->low || expected.high != box->high) return fail("the grid's box is not that of its cells");
    return true;
  }

  bool readResources(const json& ours) {
    const json* resources = fieldOf(ours, "resources");
    if (!resources) return true;
    if (!resources->is_array() || resources->size() > limits_.resources) return fail("has too many shared resources");
    for (const json& resource : *resources) {
      const std::string *uri = stringOf(resource, "uri"), *mimeType = stringOf(resource, "mimeType");
      if (!uri || !mimeType) return fail("a shared resource has no uri or no mimeType");
      tileset_.resources.push_back({*uri, *mimeType, bytesOf(resource)});
    }
    return true;
  }

  // Level after level, so that no depth of nesting meets the stack.
  bool readTree(const json& root) {
    struct Waiting {
      const json* source;
      uint32_t depth;
    };
    std::deque<Waiting> waiting = {{&root, 0}};
    uint32_t known = 1;
    for (; !waiting.empty(); waiting.pop_front()) {
      const auto [source, depth] = waiting.front();
      const std::string place = fmt::format("tile {}: ", tileset_.tiles.size());
      if (depth >= limits_.depth) return fail(place + "the tree is too deep");
      Tile tile;
      if (!readTile(*source, tile, depth == 0, place) || !readContents(*source, tile, place)) return false;
      if (const json* children = fieldOf(*source, "children")) {
        if (!children->is_array()) return fail(place + "its children are no list");
        if (children->size() > limits_.tiles - known) return fail("has too many tiles");
        for (const json& child : *children) {
          tile.children.push_back(known++);
          waiting.push_back({&child, depth + 1});
        }
      }
      tileset_.tiles.push_back(std::move(tile));
      sources_.push_back(source);
    }
    return true;
  }

  bool readTile(const json& source, Tile& tile, bool isRoot, const std::string& place) {
    const json* ours = oursOf(source);
    if (!ours) return fail(place + "has no extension TESSERA_scene");
    const auto level = unsignedOf(*ours, "level");
    const auto cells = cellsOf(*ours);
    const auto box = boxOf(*ours);
    const auto error = numberOf(source, "geometricError");
    if (!level || !cells || !box || !error) return fail(place + "its level, cells, box or geometricError is missing");
    if (isRoot ? !isString(source, "refine", "REPLACE")
               : fieldOf(source, "refine") && !isString(source, "refine", "REPLACE")) {
      return fail(place + "is not refined by REPLACE");
    }
    if (!isRoot && fieldOf(source, "transform")) return fail(place + "only the root may have a transform");
    tile.level = *level;
    tile.cells = *cells;
    tile.box = *box;
    tile.geometricError = *error;
    return true;
  }

  bool readContents(const json& source, Tile& tile, const std::string& place) {
    const json *one = fieldOf(source, "content"), *several = fieldOf(source, "contents");
    if (one && several) return fail(place + "has both content and contents");
    if (one) return readContent(*one, tile, place);
    if (!several) return true;
    if (!several->is_array() || several->size() > limits_.contentsOfTile) return fail(place + "has too many contents");
    for (const json& content : *several) {
      if (!readContent(content, tile, place)) return false;
    }
    return true;
  }

  bool readContent(const json& source, Tile& tile, const std::string& place) {
    const std::string* uri = stringOf(source, "uri");
    const json* ours = oursOf(source);
    const auto box = ours ? boxOf(*ours) : std::nullopt;
    if (!uri || !box) return fail(place + "a content has no uri or no box");
    TileContent content;
    content.uri = *uri;
    content.box = *box;
    content.surround = flagOf(*ours, "surround").value_or(false);
    content.bytes = bytesOf(*ours);
    content.cells = tile.cells;
    if (content.surround && !readSurround(*ours, content)) return fail(place + "a surround's level or error is none");
    if (fieldOf(*ours, "cells")) {
      const auto cells = cellsOf(*ours);
      if (!cells) return fail(place + "a content's cells are none");
      content.cells = *cells;
    }
    if (const json* resources = fieldOf(*ours, "resources")) {
      if (!resources->is_array()) return fail(place + "a content's resources are no list");
      for (const json& resource : *resources) {
        const auto index = unsignedFrom(resource, UINT32_MAX);
        if (!index) return fail(place + "a content's resources are no list of numbers");
        content.resources.push_back(static_cast<uint32_t>(*index));
      }
    }
    tile.contents.push_back(std::move(content));
    return true;
  }

  bool readSurround(const json& ours, TileContent& content) {
    const json *level = fieldOf(ours, "level"), *error = fieldOf(ours, "geometricError");
    if (level) {
      const auto number = unsignedFrom(*level, UINT32_MAX);
      if (!number) return false;
      content.level = static_cast<uint32_t>(*number);
    }
    if (error) {
      const auto metres = numberOf(ours, "geometricError");
      if (!metres) return false;
      content.geometricError = *metres;
    }
    return true;
  }

  // What other programs cull with has to be what ours do. The two differ by rounding alone.
  bool agreesWithBoxes(size_t index) {
    const Tile& tile = tileset_.tiles[index];
    const json& source = *sources_[index];
    if (!agrees(source, enclosingBox(tile)))
      return fail(fmt::format("tile {}: its boundingVolume is not its box", index));
    for (size_t i = 0; i < tile.contents.size(); ++i) {
      const json& content = fieldOf(source, "content") ? source["content"] : source["contents"][i];
      if (fieldOf(content, "boundingVolume") && !agrees(content, tile.contents[i].box)) {
        return fail(fmt::format("tile {}: a content's boundingVolume is not its box", index));
      }
    }
    return true;
  }

  bool agrees(const json& source, const SceneBox& box) {
    const json* volume = fieldOf(source, "boundingVolume");
    const auto given = volume ? numbersOf<12>(*volume, "box") : std::nullopt;
    if (!given) return false;
    const auto expected = boundingBoxNumbers(tileset_, box);
    double largest = 0;
    for (const double number : expected) largest = std::max(largest, std::abs(number));
    for (size_t i = 0; i < 12; ++i) {
      if (!(std::abs((*given)[i] - expected[i]) <= 1e-6 * largest)) return false;
    }
    return true;
  }

  std::string& reason_;
  const TilesetLimits& limits_;
  Tileset tileset_;
  std::vector<const json*> sources_;  // of tileset_.tiles
};

}  // namespace

std::optional<Tileset> decodeTileset(std::string_view text, std::string& reason, const TilesetLimits& limits) {
  reason.clear();
  if (text.size() > limits.textBytes) {
    reason = "is larger than any tileset should be";
    return std::nullopt;
  }
  const json file = json::parse(text, nullptr, false);
  if (!file.is_object()) {
    reason = "is not a JSON object";
    return std::nullopt;
  }
  return TilesetReader(reason, limits).read(file);
}

}  // namespace tessera
