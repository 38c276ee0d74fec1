// A scene on disk: contents in tiles/L<level>/, shared resources in resources/, and tileset.json, which is written
// last. File names contain a digest of the bytes, so that baking again into the same folder replaces nothing that the
// old tileset.json refers to: a reader sees either the old scene or the new one, and files may be cached forever.
#pragma once

#include "base/file.h"
#include "tiles/tileset.h"

namespace tessera {

class SceneFolderWriter {
 public:
  explicit SceneFolderWriter(fs::path root) : root_(std::move(root)) {}

  // Writes the file at once and returns its uri, tiles/L<level>/<name>-<digest>.glb. `name`: letters, digits, '_'.
  // Throws Error if it cannot be written.
  std::string addContent(uint32_t level, const std::string& name, std::span<const std::byte> bytes) const;
  // Writes the file at once and returns its uri, resources/<name>-<digest>.<extension>. Throws Error if it cannot be
  // written.
  std::string addResource(const std::string& name, const std::string& extension,
                          std::span<const std::byte> bytes) const;

  // Writes tileset.json, then removes those files in tiles/ and resources/ whose names follow the patterns above and
  // that tileset.json does not refer to. Throws Error if a file that it refers to does not exist.
  void commit(const Tileset& tileset) const;

 private:
  fs::path root_;
};

// Throws Error naming the file and the rule that it violates, also if a uri leads out of the folder or to no file.
Tileset readTileset(const fs::path& folder);

// Returns the file of a uri of a tileset that was read from `folder`. Throws Error if it leads out of the folder.
fs::path contentPath(const fs::path& folder, const std::string& uri);

// Returns whether the bytes of a file are those that were written, if its name contains a digest. Other names pass.
bool hasItsDigest(const fs::path& file, std::span<const std::byte> bytes);

}  // namespace tessera
