// Decodes tileset.json, which is untrusted text.
#include <fmt/format.h>

#include <deque>

#include "tiles/json_fields.h"
#include "tiles/tileset_json.h"

namespace tessera {
namespace {

using namespace json_fields;

const json* tesseraExtension(const json& object) {
  const json* extensions = getField(object, "extensions");
  return extensions ? getField(*extensions, kSceneExtension) : nullptr;
}

std::optional<Vec3d> getVector(const json& object, const char* key) {
  const auto numbers = getNumbers<3>(object, key);
  return numbers ? std::optional<Vec3d>(Vec3d(numbers->data())) : std::nullopt;
}

std::optional<Mat4d> getMatrix(const json& object, const char* key) {
  const auto numbers = getNumbers<16>(object, key);
  return numbers ? std::optional<Mat4d>(Mat4d(numbers->data())) : std::nullopt;
}

std::optional<SceneBox> readBox(const json& object) {
  const auto low = getVector(object, "low"), high = getVector(object, "high");
  return low && high ? std::optional<SceneBox>(SceneBox{*low, *high}) : std::nullopt;
}

std::optional<CellRange> readCells(const json& object) {
  const json* cells = getArray(object, "cells");
  if (!cells || cells->size() != 4) return std::nullopt;
  uint32_t numbers[4];
  for (size_t i = 0; i < 4; ++i) {
    const auto number = unsignedFrom((*cells)[i], UINT32_MAX);
    if (!number) return std::nullopt;
    numbers[i] = static_cast<uint32_t>(*number);
  }
  return CellRange{{numbers[0], numbers[1]}, {numbers[2], numbers[3]}};
}

constexpr uint64_t kMaxCoveragePixels = uint64_t{1} << 53;

// Returns the byte count of a file, which is a hint; 0 if it is not a number.
uint64_t getByteCount(const json& object) {
  const json* field = getField(object, "bytes");
  return field ? unsignedFrom(*field, uint64_t{1} << 53).value_or(0) : 0;
}

class TilesetReader {
 public:
  TilesetReader(std::string& reason, const TilesetLimits& limits) : reason_(reason), limits_(limits) {}

  std::optional<Tileset> read(const json& file) {
    if (!readAsset(file) || !readScene(*tesseraExtension(file)) || !readResources(*tesseraExtension(file)) ||
        !readCoverage(*tesseraExtension(file)) || !readExposureResponse(*tesseraExtension(file)))
      return std::nullopt;
    const auto error = getNumber(file, "geometricError");
    const json* root = getField(file, "root");
    if (!error || !root || !readTree(*root)) {
      fail("has no geometricError or no root");
      return std::nullopt;
    }
    tileset_.geometricError = *error;
    if (auto broken = validationError(tileset_)) {
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
    if (reason_.empty()) reason_ = reason;  // only the first error is reported
    return false;
  }

  bool readAsset(const json& file) {
    const json* asset = getField(file, "asset");
    if (!asset || !isString(*asset, "version", "1.1")) return fail("is not 3D Tiles 1.1");
    if (const json* required = getField(file, "extensionsRequired"); required && !required->empty()) {
      return fail("requires extensions that are not known");
    }
    const json* ours = tesseraExtension(file);
    if (!ours) return fail("has no extension TESSERA_scene");
    const auto version = getUnsigned(*ours, "version");
    if (!version) return fail("does not state its version");
    if (*version != kSceneVersion)
      return fail(fmt::format("has version {}; only {} is supported", *version, kSceneVersion));
    return true;
  }

  bool readScene(const json& ours) {
    const std::string* representation = getString(ours, "representation");
    if (!representation) return fail("does not name its representation");
    tileset_.representation = *representation;
    if (const std::string* name = getString(ours, "name")) tileset_.name = *name;
    const json* placement = getField(ours, "worldFromScene");
    if (!placement) return fail("has no worldFromScene");
    const auto rotation = getNumbers<9>(*placement, "rotation");
    const auto scale = getNumber(*placement, "scale");
    const auto translation = getVector(*placement, "translation");
    const auto source = getMatrix(ours, "sourceFromWorld");
    if (!rotation || !scale || !translation || !source) return fail("worldFromScene or sourceFromWorld lacks numbers");
    tileset_.worldFromScene = {Mat3d(rotation->data()), *scale, *translation};
    tileset_.sourceFromWorld = *source;
    return readGeoreference(ours) && readGrid(ours);
  }

  bool readGeoreference(const json& ours) {
    const json* geo = getField(ours, "georeference");
    if (!geo) return true;
    const auto latitude = getNumber(*geo, "latitude"), longitude = getNumber(*geo, "longitude");
    const auto altitude = getNumber(*geo, "altitude");
    const auto enuFromWorld = getMatrix(*geo, "enuFromWorld");
    if (!latitude || !longitude || !altitude || !enuFromWorld) return fail("the georeference lacks numbers");
    tileset_.georeference = GeoFrame{*latitude, *longitude, *altitude, *enuFromWorld};
    return true;
  }

  bool readGrid(const json& ours) {
    const json* grid = getField(ours, "grid");
    if (!grid) return fail("has no grid");
    const auto columns = getUnsigned(*grid, "columns"), rows = getUnsigned(*grid, "rows");
    const auto box = readBox(*grid);
    const auto levels = getUnsigned(ours, "levels");
    const auto near = getNumber(ours, "near");
    const auto background = getNumbers<3>(ours, "background");
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
    const json* resources = getField(ours, "resources");
    if (!resources) return true;
    if (!resources->is_array() || resources->size() > limits_.resources) return fail("has too many shared resources");
    for (const json& resource : *resources) {
      const std::string *uri = getString(resource, "uri"), *mimeType = getString(resource, "mimeType");
      if (!uri || !mimeType) return fail("a shared resource has no uri or no mimeType");
      tileset_.resources.push_back({*uri, *mimeType, getByteCount(resource)});
    }
    return true;
  }

  bool readCoverage(const json& ours) {
    const json* coverage = getField(ours, "coverage");
    if (!coverage) return true;
    if (!coverage->is_array() || coverage->size() > limits_.coverage)
      return fail("the coverage is not a list of parts");
    for (const json& part : *coverage) {
      const std::string* name = getString(part, "part");
      const json *pixels = getField(part, "pixels"), *holes = getField(part, "holes");
      const auto all = pixels ? unsignedFrom(*pixels, kMaxCoveragePixels) : std::nullopt,
                 open = holes ? unsignedFrom(*holes, kMaxCoveragePixels) : std::nullopt;
      if (!name || !all || !open) return fail("the coverage of a part lacks its name or its numbers");
      tileset_.coverage.push_back({*name, *all, *open});
    }
    return true;
  }

  bool readExposureResponse(const json& ours) {
    const json* response = getField(ours, "exposureResponse");
    if (!response) return true;
    const auto slope = getNumbers<3>(*response, "slope"), offset = getNumbers<3>(*response, "offset");
    if (!slope || !offset) return fail("the exposureResponse lacks numbers");
    tileset_.exposureResponse.emplace();
    for (size_t c = 0; c < 3; ++c) {
      tileset_.exposureResponse->slope[c] = static_cast<float>((*slope)[c]);
      tileset_.exposureResponse->offset[c] = static_cast<float>((*offset)[c]);
    }
    return true;
  }

  // Reads breadth-first, so that deeply nested tiles cannot overflow the stack.
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
      if (const json* children = getField(*source, "children")) {
        if (!children->is_array()) return fail(place + "its children are not a list");
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
    const json* ours = tesseraExtension(source);
    if (!ours) return fail(place + "has no extension TESSERA_scene");
    const auto level = getUnsigned(*ours, "level");
    const auto cells = readCells(*ours);
    const auto box = readBox(*ours);
    const auto error = getNumber(source, "geometricError");
    if (!level || !cells || !box || !error) return fail(place + "its level, cells, box or geometricError is missing");
    if (isRoot ? !isString(source, "refine", "REPLACE")
               : getField(source, "refine") && !isString(source, "refine", "REPLACE")) {
      return fail(place + "is not refined by REPLACE");
    }
    if (!isRoot && getField(source, "transform")) return fail(place + "only the root may have a transform");
    tile.level = *level;
    tile.cells = *cells;
    tile.box = *box;
    tile.geometricError = *error;
    return true;
  }

  bool readContents(const json& source, Tile& tile, const std::string& place) {
    const json *one = getField(source, "content"), *several = getField(source, "contents");
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
    const std::string* uri = getString(source, "uri");
    const json* ours = tesseraExtension(source);
    const auto box = ours ? readBox(*ours) : std::nullopt;
    if (!uri || !box) return fail(place + "a content has no uri or no box");
    if (getField(*ours, "surround")) return fail(place + "the key surround is called background_block now");
    TileContent content;
    content.uri = *uri;
    content.box = *box;
    content.backgroundBlock = getBoolean(*ours, "background_block").value_or(false);
    content.bytes = getByteCount(*ours);
    content.cells = tile.cells;
    if (content.backgroundBlock && !readBackgroundBlock(*ours, content))
      return fail(place + "a background block's level or geometric error is not valid");
    if (getField(*ours, "cells")) {
      const auto cells = readCells(*ours);
      if (!cells) return fail(place + "a content's cells are malformed");
      content.cells = *cells;
    }
    if (const json* resources = getField(*ours, "resources")) {
      if (!resources->is_array()) return fail(place + "a content's resources are not a list of numbers");
      for (const json& resource : *resources) {
        const auto index = unsignedFrom(resource, UINT32_MAX);
        if (!index) return fail(place + "a content's resources are not a list of numbers");
        content.resources.push_back(static_cast<uint32_t>(*index));
      }
    }
    tile.contents.push_back(std::move(content));
    return true;
  }

  bool readBackgroundBlock(const json& ours, TileContent& content) {
    const json *level = getField(ours, "level"), *error = getField(ours, "geometricError");
    if (level) {
      const auto number = unsignedFrom(*level, UINT32_MAX);
      if (!number) return false;
      content.level = static_cast<uint32_t>(*number);
    }
    if (error) {
      const auto metres = getNumber(ours, "geometricError");
      if (!metres) return false;
      content.geometricError = *metres;
    }
    return true;
  }

  // Checks that the bounding volumes used by other programs agree with our boxes, up to rounding.
  bool agreesWithBoxes(size_t index) {
    const Tile& tile = tileset_.tiles[index];
    const json& source = *sources_[index];
    if (!agrees(source, enclosingBox(tile)))
      return fail(fmt::format("tile {}: its boundingVolume is not its box", index));
    for (size_t i = 0; i < tile.contents.size(); ++i) {
      const json& content = getField(source, "content") ? source["content"] : source["contents"][i];
      if (getField(content, "boundingVolume") && !agrees(content, tile.contents[i].box)) {
        return fail(fmt::format("tile {}: a content's boundingVolume is not its box", index));
      }
    }
    return true;
  }

  bool agrees(const json& source, const SceneBox& box) {
    const json* volume = getField(source, "boundingVolume");
    const auto given = volume ? getNumbers<12>(*volume, "box") : std::nullopt;
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
  std::vector<const json*> sources_;  // the JSON of each tile in tileset_.tiles
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
