#include "render/cpu/open_volume_scene.h"

#include "base/error.h"
#include "tiles/scene_folder.h"
#include "tiles/volume_payload.h"

namespace tessera {
namespace {

class TreeMaker {
 public:
  explicit TreeMaker(const Tileset& tileset) : tileset_(tileset) {
    metres_ = tileset.tileFromScene().scale;
    add(0, -1);
    for (const TileContent& content : tileset.root().contents) {
      if (content.surround) made_.tree.surround = addContent(content, -1, tileset.root());
    }
    made_.tree.check();
  }
  SceneTree take() { return std::move(made_); }

 private:
  int addNode(const SceneBox& box, int parent, const Tile& tile) {
    const int index = static_cast<int>(made_.tree.tiles.size());
    TileNode node;
    node.parent = parent;
    node.low = box.low;
    node.high = box.high;
    node.geometricError = tile.geometricError / metres_;
    node.level = static_cast<int>(tile.level);
    node.hasContent = false;
    made_.tree.tiles.push_back(node);
    made_.uris.emplace_back();
    if (parent >= 0) made_.tree.tiles[parent].children.push_back(index);
    return index;
  }
  int addContent(const TileContent& content, int parent, const Tile& tile) {
    const int index = addNode(content.box, parent, tile);
    giveContent(index, content);
    return index;
  }
  void giveContent(int index, const TileContent& content) {
    made_.tree.tiles[index].hasContent = true;
    made_.tree.tiles[index].contentBytes = content.memoryBytes;
    made_.uris[index] = content.uri;
  }
  void add(uint32_t number, int parent) {
    const Tile& tile = tileset_.tiles[number];
    std::vector<const TileContent*> contents;
    for (const TileContent& content : tile.contents) {
      if (!content.surround) contents.push_back(&content);
    }
    const int index = addNode(tile.box, parent, tile);
    if (contents.size() == 1) giveContent(index, *contents[0]);
    if (contents.size() > 1) {
      throw Error(tileset_.name, "tileset.json", "has a tile with several contents, which this renderer cannot draw",
                  "bake the scene again");
    }
    for (const uint32_t child : tile.children) add(child, index);
  }

  const Tileset& tileset_;
  double metres_ = 1;
  SceneTree made_;
};

}  // namespace

SceneTree sceneTreeOf(const Tileset& tileset) {
  return TreeMaker(tileset).take();
}

VolumeFrame volumeFrameOf(const Tileset& tileset) {
  VolumeFrame frame;
  frame.rotation = tileset.worldFromScene.rotation;
  frame.scale = tileset.worldFromScene.scale;
  frame.translation = tileset.worldFromScene.translation;
  frame.low = tileset.box().low;
  frame.high = tileset.box().high;
  frame.near = tileset.near;
  return frame;
}

std::unique_ptr<VolumeRenderer> openVolumeScene(const fs::path& folder, const Tileset& tileset,
                                                VolumeRendererSettings settings) {
  if (tileset.representation != Representation::volume) {
    throw Error(folder.string(), "tileset.json",
                std::string("is a scene of '") + nameOf(tileset.representation) + "', which cannot be drawn here yet",
                "name a scene baked from a model of --method volume");
  }
  SceneTree scene = sceneTreeOf(tileset);
  for (size_t i = 0; i < scene.uris.size(); ++i) {
    TileNode& node = scene.tree.tiles[i];
    if (node.hasContent && node.contentBytes == 0) {
      node.contentBytes = bytesInMemory(readVolume(contentPath(folder, scene.uris[i])));
    }
  }
  settings.background = Eigen::Array3f(tileset.background[0], tileset.background[1], tileset.background[2]);
  const auto load = [folder, uris = scene.uris](int tile) {
    return readVolume(contentPath(folder, uris[static_cast<size_t>(tile)]));
  };
  return std::make_unique<VolumeRenderer>(volumeFrameOf(tileset), std::move(scene.tree), load, settings);
}

}  // namespace tessera
