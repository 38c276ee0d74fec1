// A scene's folder as renderers need it: the frame, the tree, and where contents come from.
#pragma once

#include "base/file.h"
#include "render/tile_cache.h"
#include "render/tile_frame.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

struct TileScene {
  TileFrame frame;
  TileTree tree;  // tiles are numbered as those of tileset.json; surrounds come last, the finest at the end
  TileSource<Content> source;  // reads files when asked; its functions may be called by several threads at a time
  std::array<float, 3> background = {0, 0, 0};
};

// Keeps a reference to the codec. Throws Error where the folder holds no scene, one of another representation, or a
// tile with several contents.
TileScene openTileScene(const fs::path& folder, const ContentCodec& codec);

TileFrame frameOf(const Tileset& tileset);

}  // namespace tessera
