#include "bake/scene_writer.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"

namespace tessera {

SceneWriter::SceneWriter(const fs::path& folder, const Capture& capture, const BlockGrid& grid,
                         const SceneDescription& about)
    : folder_(folder) {
  tileset_.representation = about.representation;
  tileset_.name = fs::weakly_canonical(capture.root).filename().string();
  tileset_.sourceFromWorld = capture.sourceFromWorld;
  tileset_.georeference = capture.geo;
  tileset_.near = about.near;
  tileset_.background = about.background;
  placeOn(tileset_, grid);
}

void SceneWriter::beginLevel(uint32_t texels) {
  levels_.emplace_back().texels = texels;
}

TileContent SceneWriter::write(const std::string& name, std::span<const std::byte> file,
                               const ContentSummary& content) {
  CHECK(!levels_.empty());
  TileContent entry;
  entry.uri = folder_.addContent(static_cast<uint32_t>(levels_.size() - 1), name, file);
  entry.bytes = file.size();
  entry.box = content.box;
  BakedLevel& sizes = levels_.back().sizes;
  sizes.bytesOnDisk += file.size();
  sizes.bytesInMemory += content.bytesInMemory;
  sizes.macroblocks += content.macroblocks;
  return entry;
}

void SceneWriter::add(const CellGroup& cells, std::span<const std::byte> file, const ContentSummary& content) {
  TileContent entry = write(fmt::format("block_{}_{}", cells.first[0], cells.first[1]), file, content);
  entry.cells = CellRange{cells.first, cells.end};
  levels_.back().contents.push_back(std::move(entry));
}

void SceneWriter::addSurround(std::span<const std::byte> file, const ContentSummary& content) {
  TileContent entry = write("surround", file, content);
  entry.surround = true;
  entry.cells = tileset_.allCells();
  entry.level = static_cast<uint32_t>(levels_.size() - 1);
  // Its domain is 4 wide.
  entry.geometricError = content.largestScale * 4.0 / levels_.back().texels * tileset_.tileFromScene().scale;
  levels_.back().surround = std::move(entry);
}

// Adds the tile of a group and, below it, those that it merges. Returns its number.
uint32_t SceneWriter::addTiles(size_t level, size_t group) {
  const uint32_t number = static_cast<uint32_t>(tileset_.tiles.size());
  const TileContent& content = levels_[level].contents[group];
  Tile tile;
  tile.level = static_cast<uint32_t>(level);
  tile.cells = content.cells;
  tile.box = content.box;
  tile.geometricError = 2.0 / levels_[level].texels * tileset_.tileFromScene().scale;
  tile.contents.push_back(content);
  tileset_.tiles.push_back(tile);
  for (size_t below = 0; level > 0 && below < levels_[level - 1].contents.size(); ++below) {
    if (!tile.cells.contains(levels_[level - 1].contents[below].cells)) continue;
    const uint32_t child = addTiles(level - 1, below);
    tileset_.tiles[number].children.push_back(child);
  }
  return number;
}

// A root without contents of its own, where nothing stands for all.
void SceneWriter::addRoot(const Level& top) {
  Tile root;
  root.level = tileset_.levels++;
  root.cells = tileset_.allCells();
  root.box = tileset_.box();
  for (const TileContent& content : top.contents) {
    root.box.low = root.box.low.cwiseMin(content.box.low);
    root.box.high = root.box.high.cwiseMax(content.box.high);
  }
  root.geometricError = tileset_.tileFromScene().scale;
  tileset_.tiles.push_back(root);
}

BakedScene SceneWriter::commit() {
  CHECK(!levels_.empty());
  tileset_.levels = static_cast<uint32_t>(levels_.size());
  const size_t top = levels_.size() - 1;
  if (levels_[top].contents.size() == 1) {
    addTiles(top, 0);
  } else {
    addRoot(levels_[top]);
    for (size_t group = 0; group < levels_[top].contents.size(); ++group) {
      const uint32_t child = addTiles(top, group);
      tileset_.tiles[0].children.push_back(child);
    }
  }
  for (const Level& level : levels_) {
    if (level.surround) tileset_.tiles[0].contents.push_back(*level.surround);
  }
  tileset_.geometricError = tileset_.tileFromScene().scale * std::max(tileset_.columns, tileset_.rows);
  folder_.commit(tileset_);
  BakedScene baked{tileset_, {}};
  for (const Level& level : levels_) baked.levels.push_back(level.sizes);
  return baked;
}

}  // namespace tessera
