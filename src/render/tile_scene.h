// A scene folder as renderers need it: the frame, the tile tree, and the source of contents.
#pragma once

#include "base/file.h"
#include "render/tile_cache.h"
#include "render/tile_frame.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

struct TileScene {
  TileFrame frame;
  TileTree tree;  // tiles are numbered as in tileset.json; background blocks come last, the finest at the end
  TileSource<Content> source;  // reads files on demand; its functions may be called by several threads at a time
  std::array<float, 3> background = {0, 0, 0};
};

// Keeps a reference to the codec. Throws Error if the folder holds no scene, a scene of another representation, or a
// tile with several contents.
TileScene openTileScene(const fs::path& folder, const ContentCodec& codec);

TileFrame makeTileFrame(const Tileset& tileset);

}  // namespace tessera
