// The ordinary glTF mesh that a content of `mesh` contains for programs that know nothing of neural textures: the same
// triangles with a base colour texture.
#pragma once

#include <string>
#include <vector>

#include "base/image.h"
#include "representations/mesh/content/mesh_content.h"
#include "tiles/content_file.h"
#include "tiles/tileset.h"

namespace tessera {

// Opacities below it are cut out. The image is nearest to that of composited hits then (0.5 shows too little).
inline constexpr double kFallbackAlphaCutoff = 0.4;

// Collects the parts of one content.
class FallbackMesh {
 public:
  // Adds buffer views to `file`, to which it keeps a reference. tileFromScene: places the triangles.
  FallbackMesh(ContentFileWriter& file, const Similarity& tileFromScene) : file_(file), tileFromScene_(tileFromScene) {}

  // Adds the triangles of a part, unless it has none. `textureUri`: relative to the content's file, of a texture with
  // the layout of the part's textures.
  void add(const PatchSet& part, const std::string& textureUri);

  const GltfScene& scene() const { return scene_; }

 private:
  size_t addAccessor(std::span<const std::byte> bytes, uint32_t target, uint32_t componentType, size_t count,
                     const char* type);
  size_t addMaterial(const std::string& textureUri);

  ContentFileWriter& file_;
  Similarity tileFromScene_;
  GltfScene scene_;
};

}  // namespace tessera
