// Reads one level of detail of a scene of `mesh`, content by content, for exports.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/image.h"
#include "representations/mesh/content/mesh_content.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

// A content of the tree that belongs to a level.
struct LevelContent {
  size_t tile = 0, number = 0;  // of Tileset::tiles, and of the contents of this tile
  std::string name;             // "tile_<column>_<row>" by its first cell, or "background_block"
};

class MeshLevel {
 public:
  // Throws Error unless `scene` is a scene of mesh that has this level. `format`: names the export in messages.
  MeshLevel(fs::path scene, uint32_t level, const std::string& format);

  const Tileset& tileset() const { return tileset_; }
  uint32_t level() const { return level_; }
  // What a renderer draws if nothing finer than the level is drawn: the tiles that cover the scene, then the background
  // block, if there is one.
  const std::vector<LevelContent>& contents() const { return contents_; }

  // Reads a content with the resources that it needs: one content is in memory at a time. Throws Error.
  std::unique_ptr<Content> read(const LevelContent& content) const;
  // Returns the base colour textures of its parts with patches, in their order. Throws Error if it has none, because it
  // was baked without, or if one does not fit its part.
  std::vector<Bytes> readBaseColours(const LevelContent& content, const MeshContent& mesh) const;

 private:
  const TileContent& declared(const LevelContent& content) const {
    return tileset_.tiles[content.tile].contents[content.number];
  }
  void listContents();

  fs::path scene_;
  uint32_t level_;
  Tileset tileset_;
  std::vector<LevelContent> contents_;
};

// Returns the name of a part of a content: the content's, with a number if there are several parts.
std::string partName(const LevelContent& content, const MeshContent& mesh, size_t part);

// What exports say about a scene: its name, level, and where on Earth its origin is, if it is georeferenced.
nlohmann::ordered_json describeLevel(const MeshLevel& level);

}  // namespace tessera
