#include "bake/scene_writer.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "tiles/tileset_json.h"

namespace tessera {

namespace {

// Returns the file extension of a shared resource.
std::string mimeTypeExtension(const std::string& mimeType) {
  if (mimeType == "model/gltf-binary") return "glb";
  if (mimeType.starts_with("image/")) return mimeType.substr(std::string_view("image/").size());
  return "bin";
}

void addCount(std::vector<std::pair<std::string, uint64_t>>& counts, const std::pair<std::string, uint64_t>& count) {
  const auto same = std::find_if(counts.begin(), counts.end(), [&](const auto& c) { return c.first == count.first; });
  if (same == counts.end()) {
    counts.push_back(count);
  } else {
    same->second += count.second;
  }
}

}  // namespace

SceneWriter::SceneWriter(const fs::path& folder, const Capture& capture, const SceneDescription& about)
    : folder_(folder) {
  std::error_code status;
  fs::create_directories(folder, status);
  if (status || ::access(folder.c_str(), W_OK) != 0) {
    throw Error(folder.string(), "", "cannot be written: " + (status ? status.message() : std::strerror(errno)),
                "check its permissions, or name another folder");
  }
  tileset_.representation = about.representation;
  tileset_.name = about.name.empty() ? fs::weakly_canonical(capture.root).filename().string() : about.name;
  tileset_.sourceFromWorld = capture.sourceFromWorld;
  tileset_.georeference = capture.geo;
  tileset_.near = about.near;
  tileset_.background = about.background;
  tileset_.coverage = about.coverage;
  tileset_.exposureResponse = about.exposureResponse;
  placeOn(tileset_, about.grid);
  requireWritable(tileset_);
  if (const auto broken = frameError(tileset_)) {
    throw Error((capture.root / "transforms.json").string(), "", "no scene can be made of this capture: " + *broken,
                "import the photos again");
  }
}

uint32_t SceneWriter::addResource(const std::string& name, const std::string& mimeType,
                                  std::span<const std::byte> bytes) {
  const std::string uri = folder_.addResource(name, mimeTypeExtension(mimeType), bytes);
  for (size_t i = 0; i < tileset_.resources.size(); ++i) {
    if (tileset_.resources[i].uri == uri) return static_cast<uint32_t>(i);
  }
  tileset_.resources.push_back({uri, mimeType, bytes.size()});
  return static_cast<uint32_t>(tileset_.resources.size() - 1);
}

void SceneWriter::add(uint32_t level, const std::optional<CellRange>& cells, std::span<const std::byte> glb,
                      const ContentSummary& content, const std::vector<uint32_t>& resources) {
  CHECK(cells.has_value() != content.isBackground);
  if (level >= levels_.size()) levels_.resize(level + size_t{1});
  Level& at = levels_[level];
  const std::string name = cells ? fmt::format("block_{}_{}", cells->first[0], cells->first[1]) : "background_block";
  TileContent entry;
  entry.uri = folder_.addContent(level, name, glb);
  entry.bytes = glb.size();
  entry.box = content.box;
  entry.resources = resources;
  at.sizes.bytesOnDisk += glb.size();
  at.sizes.bytesInMemory += content.memoryBytes;
  for (const auto& count : content.counts) addCount(at.sizes.counts, count);
  const double geometricError = content.geometricError * tileset_.tileFromScene().scale;
  if (cells) {
    entry.cells = *cells;
    at.contents.push_back(std::move(entry));
    at.geometricErrors.push_back(geometricError);
    return;
  }
  CHECK(!at.background);
  entry.backgroundBlock = true;
  entry.cells = tileset_.allCells();
  entry.level = level;
  entry.geometricError = geometricError;
  at.background = std::move(entry);
}

// Adds the tile of a group and, below it, those of the groups that it merges. Returns its index.
uint32_t SceneWriter::addTiles(size_t level, size_t group) {
  const uint32_t number = static_cast<uint32_t>(tileset_.tiles.size());
  const TileContent& content = levels_[level].contents[group];
  Tile tile;
  tile.level = static_cast<uint32_t>(level);
  tile.cells = content.cells;
  tile.box = content.box;
  tile.geometricError = levels_[level].geometricErrors[group];
  tile.contents.push_back(content);
  tileset_.tiles.push_back(tile);
  for (size_t below = 0; level > 0 && below < levels_[level - 1].contents.size(); ++below) {
    if (!tile.cells.contains(levels_[level - 1].contents[below].cells)) continue;
    const uint32_t child = addTiles(level - 1, below);
    tileset_.tiles[number].children.push_back(child);
    SceneBox& box = tileset_.tiles[number].box;  // contents of finer levels may reach further
    box.low = box.low.cwiseMin(tileset_.tiles[child].box.low);
    box.high = box.high.cwiseMax(tileset_.tiles[child].box.high);
  }
  return number;
}

// Adds a root without contents of its own, for scenes whose top level has several tiles.
void SceneWriter::addRoot() {
  Tile root;
  root.level = tileset_.levels++;
  root.cells = tileset_.allCells();
  root.box = tileset_.box();
  root.geometricError = tileset_.tileFromScene().scale;
  tileset_.tiles.push_back(root);
}

BakedScene SceneWriter::commit() {
  CHECK(!levels_.empty());
  for (const Level& level : levels_) CHECK(!level.contents.empty());
  tileset_.levels = static_cast<uint32_t>(levels_.size());
  const size_t top = levels_.size() - 1;
  if (levels_[top].contents.size() == 1) {
    addTiles(top, 0);
  } else {
    addRoot();
    for (size_t group = 0; group < levels_[top].contents.size(); ++group) {
      const uint32_t child = addTiles(top, group);
      tileset_.tiles[0].children.push_back(child);
      SceneBox& box = tileset_.tiles[0].box;
      box.low = box.low.cwiseMin(tileset_.tiles[child].box.low);
      box.high = box.high.cwiseMax(tileset_.tiles[child].box.high);
    }
  }
  for (const Level& level : levels_) {
    if (level.background) tileset_.tiles[0].contents.push_back(*level.background);
  }
  tileset_.geometricError = tileset_.tileFromScene().scale * std::max(tileset_.columns, tileset_.rows);
  folder_.commit(tileset_);
  BakedScene baked{tileset_, {}};
  for (const Level& level : levels_) baked.levels.push_back(level.sizes);
  return baked;
}

}  // namespace tessera
