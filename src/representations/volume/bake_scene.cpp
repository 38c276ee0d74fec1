// Models of all levels to a tree of tiles on disk.
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/log.h"
#include "representations/volume/bake_volume.h"
#include "tiles/scene_folder.h"
#include "tiles/volume_payload.h"

namespace tessera {
namespace {

struct LevelContents {
  std::vector<TileContent> contents;  // [groups]
  std::optional<TileContent> surround;
  double texel = 0;  // scene units
  BakedLevel sizes;
};

constexpr std::array<float, 3> kHazySky = {0.74f, 0.8f, 0.86f}, kBlack = {0, 0, 0};

Tileset emptyTileset(const VolumeModel& model, const Capture& capture, uint32_t levels,
                     const BakeVolumeOptions& options) {
  Tileset tileset;
  tileset.representation = Representation::volume;
  tileset.name = fs::weakly_canonical(capture.root).filename().string();
  tileset.sourceFromWorld = capture.sourceFromWorld;
  tileset.georeference = capture.geo;
  tileset.near = model.space().near;
  tileset.background = options.background.value_or(model.config().randomBackground ? kHazySky : kBlack);
  tileset.levels = levels;
  placeOn(tileset, model.grid());
  return tileset;
}

SceneBox boxOf(const VolumeContent& content) {
  SceneBox box{Vec3d::Constant(1e30), Vec3d::Constant(-1e30)};
  for (const VolumePart& part : content.parts) {
    box.low = box.low.cwiseMin(Vec3d(part.low[0], part.low[1], part.low[2]));
    box.high = box.high.cwiseMax(Vec3d(part.high[0], part.high[1], part.high[2]));
  }
  return box;
}

struct LevelToBake {
  VolumeModel& model;
  uint32_t level = 0;
  const Capture& capture;
  const Tileset& tileset;
  const SceneFolderWriter& folder;
  const BakeVolumeOptions& options;
};

LevelContents bakeLevel(const LevelToBake& of) {
  const auto& [model, level, capture, tileset, folder, options] = of;
  const std::vector<AliveTexels> alive = findAliveTexels(model, capture, options);
  const std::vector<CellGroup>& cells = model.groups().cells;
  LevelContents made;
  made.texel = 2.0 / model.virtualGrid().planes;
  for (uint32_t group = 0; group < model.groups().groups(); ++group) {
    const bool surround = group >= cells.size();
    const VolumeContent content = bakeGroup(model, group, alive);
    const std::string name =
        surround ? "surround" : fmt::format("block_{}_{}", cells[group].first[0], cells[group].first[1]);
    const Bytes bytes = encodeVolume(content, options.effort);
    TileContent entry;
    entry.uri = folder.addContent(level, name, bytes);
    entry.bytes = bytes.size();
    entry.surround = surround;
    entry.cells = surround ? tileset.allCells() : CellRange{cells[group].first, cells[group].end};
    entry.box = boxOf(content);
    made.sizes.bytesOnDisk += bytes.size();
    made.sizes.bytesInMemory += bytesInMemory(content);
    for (const VolumePart& part : content.parts) made.sizes.macroblocks += part.storedMacroblocks();
    if (surround) {
      const std::array<float, 3>& scale = content.parts[0].scale;
      entry.level = level;
      entry.geometricError = *std::max_element(scale.begin(), scale.end()) * 4.0 / model.virtualGrid().planes *
                             tileset.tileFromScene().scale;
      made.surround = entry;
    } else {
      made.contents.push_back(entry);
    }
  }
  return made;
}

// Adds the tile of a group and, below it, those that it merges. Returns its number.
uint32_t addTiles(Tileset& tileset, const std::vector<LevelContents>& levels, size_t level, size_t group) {
  const uint32_t number = static_cast<uint32_t>(tileset.tiles.size());
  Tile tile;
  tile.level = static_cast<uint32_t>(level);
  tile.cells = levels[level].contents[group].cells;
  tile.box = levels[level].contents[group].box;
  tile.geometricError = levels[level].texel * tileset.tileFromScene().scale;
  tile.contents.push_back(levels[level].contents[group]);
  tileset.tiles.push_back(tile);
  for (size_t below = 0; level > 0 && below < levels[level - 1].contents.size(); ++below) {
    if (!tile.cells.contains(levels[level - 1].contents[below].cells)) continue;
    const uint32_t child = addTiles(tileset, levels, level - 1, below);
    tileset.tiles[number].children.push_back(child);
  }
  return number;
}

// A root without contents of its own, where nothing stands for all.
void addRoot(Tileset& tileset, const LevelContents& top) {
  Tile root;
  root.level = tileset.levels++;
  root.cells = tileset.allCells();
  root.box = tileset.box();
  for (const TileContent& content : top.contents) {
    root.box.low = root.box.low.cwiseMin(content.box.low);
    root.box.high = root.box.high.cwiseMax(content.box.high);
  }
  root.geometricError = tileset.tileFromScene().scale;
  tileset.tiles.push_back(root);
}

}  // namespace

BakedVolume bakeVolume(const LevelModels& models, uint32_t levels, const Capture& capture, const fs::path& scene,
                       const BakeVolumeOptions& options) {
  const SceneFolderWriter folder(scene);
  BakedVolume baked;
  Tileset& tileset = baked.tileset;
  std::vector<LevelContents> made;
  const int64_t photos = static_cast<int64_t>(capture.photosIn(Split::train).size());
  for (uint32_t level = 0; level < levels; ++level) {
    BakeVolumeOptions ofLevel = options;
    ofLevel.onPhoto = [&](int64_t done, int64_t) { options.onPhoto(level * photos + done, levels * photos); };
    ofLevel.stride <<= level;  // as many rays through its larger texels
    const std::unique_ptr<VolumeModel> model = models(level);
    if (level == 0) {
      tileset = emptyTileset(*model, capture, levels, options);
      if (model->config().literalEq3) {
        warn(
            "the model was trained with literal_eq3; scenes multiply the network's colour by the block's opacity, and "
            "look different");
      }
    }
    made.push_back(bakeLevel({*model, level, capture, tileset, folder, ofLevel}));
    baked.levels.push_back(made.back().sizes);
  }
  const size_t top = levels - 1;
  if (made[top].contents.size() == 1) {
    addTiles(tileset, made, top, 0);
  } else {
    addRoot(tileset, made[top]);
    for (size_t group = 0; group < made[top].contents.size(); ++group) {
      const uint32_t child = addTiles(tileset, made, top, group);
      tileset.tiles[0].children.push_back(child);
    }
  }
  for (const LevelContents& level : made) {
    if (level.surround) tileset.tiles[0].contents.push_back(*level.surround);
  }
  tileset.geometricError = tileset.tileFromScene().scale * std::max(tileset.columns, tileset.rows);
  folder.commit(tileset);
  return baked;
}

}  // namespace tessera
