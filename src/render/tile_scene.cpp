#include "render/tile_scene.h"

#include <fmt/format.h>

#include <functional>
#include <map>

#include "base/error.h"
#include "tiles/hash_content.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"
#include "tiles/volume_content.h"

namespace tessera {
namespace {

struct PromisedFile {
  fs::path path;
  size_t tile = 0;  // of tileset.json
  TileContent promised;
};

}  // namespace

TileFrame frameOf(const Tileset& tileset) {
  TileFrame frame;
  frame.rotation = tileset.worldFromScene.rotation;
  frame.scale = tileset.worldFromScene.scale;
  frame.translation = tileset.worldFromScene.translation;
  frame.low = tileset.box().low;
  frame.high = tileset.box().high;
  frame.near = tileset.near;
  return frame;
}

template <class Content>
TileScene<Content> openTileScene(const fs::path& folder) {
  const Tileset tileset = readTileset(folder);
  if (tileset.representation != representationOf<Content>()) {
    throw Error(
        (folder / "tileset.json").string(), "",
        fmt::format("is a scene of {}, not of {}", nameOf(tileset.representation), nameOf(representationOf<Content>())),
        "draw it with a viewer that knows it");
  }
  TileScene<Content> scene;
  scene.frame = frameOf(tileset);
  scene.background = tileset.background;
  scene.tree.columns = static_cast<int>(tileset.columns);
  scene.tree.rows = static_cast<int>(tileset.rows);
  const double metres = tileset.tileFromScene().scale;  // of one scene unit
  std::vector<PromisedFile> files(tileset.tiles.size());
  std::map<uint32_t, PromisedFile, std::greater<>> surrounds;  // by level, the coarsest first
  for (size_t i = 0; i < tileset.tiles.size(); ++i) {
    const Tile& tile = tileset.tiles[i];
    TileNode node;
    node.cells = {static_cast<int>(tile.cells.first[0]), static_cast<int>(tile.cells.first[1]),
                  static_cast<int>(tile.cells.end[0]), static_cast<int>(tile.cells.end[1])};
    node.low = tile.box.low;
    node.high = tile.box.high;
    node.geometricError = tile.geometricError / metres;
    node.level = static_cast<int>(tile.level);
    node.children.assign(tile.children.begin(), tile.children.end());
    node.hasContent = false;
    for (const TileContent& content : tile.contents) {
      if (!content.surround && node.hasContent) {
        throw Error((folder / "tileset.json").string(), fmt::format("tile {}", i),
                    "has several contents, which the format allows and this renderer does not draw",
                    "give each a tile of its own");
      }
      node.hasContent |= !content.surround;
      PromisedFile& file = content.surround ? surrounds[content.level] : files[i];
      file = {contentPath(folder, content.uri), i, content};
    }
    scene.tree.tiles.push_back(std::move(node));
  }
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    for (const int child : scene.tree.tiles[i].children) scene.tree.tiles[child].parent = static_cast<int>(i);
  }
  for (const auto& [level, file] : surrounds) {
    TileNode node;
    node.isSurround = true;
    node.low = scene.frame.low;
    node.high = scene.frame.high;
    node.level = static_cast<int>(level);
    node.geometricError = file.promised.geometricError / metres;
    const int number = static_cast<int>(files.size());
    if (scene.tree.surround < 0) {
      scene.tree.surround = number;
    } else {
      node.parent = number - 1;
      scene.tree.tiles.back().children = {number};
    }
    scene.tree.tiles.push_back(std::move(node));
    files.push_back(file);
  }
  scene.source.bytes = [files](int tile) { return readDecodedBytes<Content>(files[tile].path); };
  scene.source.load = [files](int tile) {
    const PromisedFile& file = files[tile];
    return readPromisedContent<Content>(file.path, file.tile, file.promised);
  };
  scene.source.folder = folder.string();
  scene.source.file = [files](int tile) { return files[tile].path.string(); };
  return scene;
}

template TileScene<VolumeContent> openTileScene(const fs::path&);
template TileScene<HashContent> openTileScene(const fs::path&);

}  // namespace tessera
