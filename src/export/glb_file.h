// Writes a binary glTF file piece by piece: what is added goes to disk at once, so that a file may be larger than
// memory.
#pragma once

#include <fstream>
#include <span>

#include "base/file.h"
#include "tiles/gltf_scene.h"

namespace tessera {

class GlbFile {
 public:
  // Begins to write next to `place`. Throws Error if that is not possible, or if `place` is a folder.
  explicit GlbFile(fs::path place);
  ~GlbFile();  // without commit(), nothing is left on disk
  GlbFile(const GlbFile&) = delete;
  GlbFile& operator=(const GlbFile&) = delete;

  // Adds a buffer view and returns its index (ContentFileWriter::addView). `bytes` must not be empty. Throws Error if
  // the disk is full or the file becomes larger than binary glTF allows.
  size_t addView(std::span<const std::byte> bytes, uint32_t target = 0);
  // Makes the file appear at its place, with the members of `asset` except its buffer and its views, which are added.
  // CHECKs that there is a view. Returns the size of the file in bytes. Throws Error as addView does.
  uint64_t commit(GltfScene::Json asset);

 private:
  [[noreturn]] void fail() const;

  fs::path place_, spool_, beside_;
  std::ofstream out_;
  uint64_t bytes_ = 0;
  GltfScene::Json views_ = GltfScene::Json::array();
};

}  // namespace tessera
