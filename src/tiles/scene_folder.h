// A scene on disk: tileset.json, written last; contents in tiles/L<level>/, what they share in resources/. Names hold a
// digest of the bytes, so that baking again into the same folder replaces nothing that the old tileset.json speaks of:
// a reader sees the old scene or the new one, and files may be cached forever.
#pragma once

#include "base/file.h"
#include "tiles/tileset.h"

namespace tessera {

class SceneFolderWriter {
 public:
  explicit SceneFolderWriter(fs::path root) : root_(std::move(root)) {}

  // Written at once; returns the uri, tiles/L<level>/<name>-<digest>.glb. `name`: letters, digits, '_'.
  std::string addContent(uint32_t level, const std::string& name, std::span<const std::byte> bytes) const;
  // resources/<name>-<digest>.<extension>.
  std::string addResource(const std::string& name, const std::string& extension,
                          std::span<const std::byte> bytes) const;

  // Writes tileset.json, then removes the files in tiles/ and resources/ that have such names and that it does not
  // speak of. Throws Error when a
  // file that it names is not there.
  void commit(const Tileset& tileset) const;

 private:
  fs::path root_;
};

// Throws Error naming the file and the rule that it breaks, also when a uri leads out of the folder or to nothing.
Tileset readTileset(const fs::path& folder);

// The file of a uri of a tileset that was read from `folder`. Throws Error when it leads out of it.
fs::path contentPath(const fs::path& folder, const std::string& uri);

}  // namespace tessera
