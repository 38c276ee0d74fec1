#include "render/tile_scene.h"

#include <fmt/format.h>

#include <functional>
#include <map>
#include <mutex>

#include "base/error.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

struct DeclaredFile {
  fs::path path;
  size_t tile = 0;  // index in tileset.json
  TileContent declared;
};

// The shared resources of a scene: each is read when a content first needs it and lives as long as some content does.
// Thread-safe.
class SceneResources {
 public:
  SceneResources(const fs::path& folder, const ContentCodec& codec, const std::vector<SharedResource>& described)
      : codec_(codec), described_(described), held_(described.size()), reading_(described.size()) {
    for (const SharedResource& resource : described) files_.push_back(contentPath(folder, resource.uri));
  }

  Resources of(const TileContent& content) {
    Resources resources;
    for (const uint32_t number : content.resources) resources.push_back(of(number));
    return resources;
  }
  // Returns those that are in memory, without waiting for files.
  Resources present(const TileContent& content) {
    Resources resources;
    for (const uint32_t number : content.resources) resources.push_back(present(number));
    return resources;
  }
  uint64_t countResourceBytes(int number) const {
    return readResourceBytes(files_[number], codec_, described_[number]);
  }

 private:
  std::shared_ptr<const Resource> of(uint32_t number) {
    const std::lock_guard reading(reading_[number]);  // others that need it wait; other resources can be read meanwhile
    if (auto resource = present(number)) return resource;
    std::shared_ptr<const Resource> resource = readResource(files_[number], codec_, described_[number]);
    const std::lock_guard lock(mutex_);
    held_[number] = resource;
    return resource;
  }
  std::shared_ptr<const Resource> present(uint32_t number) {
    const std::lock_guard lock(mutex_);
    return held_[number].lock();
  }

  const ContentCodec& codec_;
  std::vector<SharedResource> described_;
  std::vector<fs::path> files_;
  std::mutex mutex_;  // guards held_
  std::vector<std::weak_ptr<const Resource>> held_;
  std::vector<std::mutex> reading_;  // one for each resource
};

}  // namespace

TileFrame makeTileFrame(const Tileset& tileset) {
  TileFrame frame;
  frame.rotation = tileset.worldFromScene.rotation;
  frame.scale = tileset.worldFromScene.scale;
  frame.translation = tileset.worldFromScene.translation;
  frame.low = tileset.box().low;
  frame.high = tileset.box().high;
  frame.near = tileset.near;
  return frame;
}

TileScene openTileScene(const fs::path& folder, const ContentCodec& codec) {
  const Tileset tileset = readTileset(folder);
  if (tileset.representation != codec.representation()) {
    throw Error((folder / "tileset.json").string(), "",
                fmt::format("is a scene of {}, not of {}", tileset.representation, codec.representation()),
                "open it with a viewer that supports it");
  }
  if (const auto tile = tileWithoutOrder(tileset); tile && !codec.contentsMayOverlap()) {
    throw Error((folder / "tileset.json").string(), fmt::format("tile {}", *tile), "contents of a tile have no order",
                "bake the scene again");
  }
  if (const auto tile = tileBeyondItsCells(tileset); tile && !codec.contentsMayOverlap()) {
    throw Error((folder / "tileset.json").string(), fmt::format("tile {}", *tile), "its box is not within its cells",
                "bake the scene again");
  }
  TileScene scene;
  scene.frame = makeTileFrame(tileset);
  scene.background = tileset.background;
  scene.tree.columns = static_cast<int>(tileset.columns);
  scene.tree.rows = static_cast<int>(tileset.rows);
  const double metres = tileset.tileFromScene().scale;  // world units per scene unit; metres if georeferenced
  std::vector<DeclaredFile> files(tileset.tiles.size());
  std::map<uint32_t, DeclaredFile, std::greater<>> backgroundBlocks;  // by level, the coarsest first
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
      if (!content.backgroundBlock && node.hasContent) {
        throw Error((folder / "tileset.json").string(), fmt::format("tile {}", i),
                    "has several contents, which the format allows and this renderer does not support",
                    "give each a tile of its own");
      }
      node.hasContent |= !content.backgroundBlock;
      DeclaredFile& file = content.backgroundBlock ? backgroundBlocks[content.level] : files[i];
      file = {contentPath(folder, content.uri), i, content};
    }
    scene.tree.tiles.push_back(std::move(node));
  }
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    for (const int child : scene.tree.tiles[i].children) scene.tree.tiles[child].parent = static_cast<int>(i);
  }
  for (const auto& [level, file] : backgroundBlocks) {
    TileNode node;
    node.isBackgroundBlock = true;
    node.low = scene.frame.low;
    node.high = scene.frame.high;
    node.level = static_cast<int>(level);
    node.geometricError = file.declared.geometricError / metres;
    const int number = static_cast<int>(files.size());
    if (scene.tree.backgroundBlock < 0) {
      scene.tree.backgroundBlock = number;
    } else {
      node.parent = number - 1;
      scene.tree.tiles.back().children = {number};
    }
    scene.tree.tiles.push_back(std::move(node));
    files.push_back(file);
  }
  const auto resources = std::make_shared<SceneResources>(folder, codec, tileset.resources);
  scene.source.bytes = [files, &codec](int tile) { return readDecodedBytes(files[tile].path, codec); };
  scene.source.load = [files, resources, &codec](int tile) {
    const DeclaredFile& file = files[tile];
    return readVerifiedContent(file.path, codec, file.tile, file.declared, resources->of(file.declared));
  };
  scene.source.tileResources = [files](int tile) {
    const std::vector<uint32_t>& numbers = files[tile].declared.resources;
    return std::vector<int>(numbers.begin(), numbers.end());
  };
  scene.source.holdResources = [files, resources](int tile) {
    return std::make_shared<const Resources>(resources->present(files[tile].declared));
  };
  scene.source.bytesOfResource = [resources](int resource) { return resources->countResourceBytes(resource); };
  scene.source.folder = folder.string();
  scene.source.file = [files](int tile) { return files[tile].path.string(); };
  return scene;
}

}  // namespace tessera
