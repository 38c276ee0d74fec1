// A `volume` scene on disk, ready to be drawn on the processor.
#pragma once

#include "base/file.h"
#include "render/cpu/volume_renderer.h"
#include "tiles/tileset.h"

namespace tessera {

// The tree that renderers choose from. Contents of `tileset`'s tiles become one node each, those of one tile side by
// side.
struct SceneTree {
  TileTree tree;
  std::vector<std::string> uris;  // [tree.tiles]: of each one's content; empty without
};
SceneTree sceneTreeOf(const Tileset& tileset);

VolumeFrame volumeFrameOf(const Tileset& tileset);

// Throws Error naming the file when the scene is no `volume`, or is broken. Contents are read from `folder` when they
// are needed.
std::unique_ptr<VolumeRenderer> openVolumeScene(const fs::path& folder, const Tileset& tileset,
                                                VolumeRendererSettings settings);

}  // namespace tessera
