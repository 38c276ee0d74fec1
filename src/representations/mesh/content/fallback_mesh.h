// The ordinary glTF mesh that a content of `mesh` contains for programs that know nothing of neural textures: the same
// triangles with a base colour texture. Exports write it, too.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/image.h"
#include "representations/mesh/content/mesh_content.h"
#include "tiles/content_file.h"
#include "tiles/tileset.h"

namespace tessera {

// Opacities below it are cut out. The image is nearest to that of composited hits then (0.5 shows too little).
inline constexpr double kFallbackAlphaCutoff = 0.4;

// The triangles of a part as programs know them: one vertex for each corner of a patch.
struct OrdinaryTriangles {
  Vec3d middle = Vec3d::Zero();  // to which positions are relative, so that floats are precise enough
  std::vector<float> positions;  // [patches][4][3]
  std::vector<float> places;     // [patches][4][2], in the part's textures: 0 to 1, rows downwards
  std::vector<uint32_t> corners;
};
// Corner 3 of a patch with one triangle, which no triangle has, is at corner 0.
OrdinaryTriangles makeOrdinaryTriangles(const PatchSet& part, const Similarity& frameFromScene);

// Returns an image of a glTF asset that is a file of its own. `uri`: relative to the asset.
GltfScene::Json pngAt(const std::string& uri);

// Collects the parts of one content, or of several.
class FallbackMesh {
 public:
  // Adds a buffer view and returns its index (ContentFileWriter::addView).
  using AddView = std::function<size_t(std::span<const std::byte> bytes, uint32_t target)>;

  // tileFromScene: places the triangles.
  FallbackMesh(AddView addView, const Similarity& tileFromScene)
      : addView_(std::move(addView)), tileFromScene_(tileFromScene) {}
  // Adds buffer views to `file`, to which it keeps a reference.
  FallbackMesh(ContentFileWriter& file, const Similarity& tileFromScene)
      : FallbackMesh([&file](std::span<const std::byte> bytes, uint32_t target) { return file.addView(bytes, target); },
                     tileFromScene) {}

  // Adds the triangles of a part as a node, unless it has none. `image`: an element of the asset's `images`, of a
  // texture with the layout of the part's textures; null: the triangles have no material. `name`: of the node, if not
  // empty.
  void add(const PatchSet& part, const GltfScene::Json& image, const std::string& name = "");

  const GltfScene& scene() const { return scene_; }

 private:
  size_t addAccessor(std::span<const std::byte> bytes, uint32_t target, uint32_t componentType, size_t count,
                     const char* type);
  size_t addMaterial(const GltfScene::Json& image);

  AddView addView_;
  Similarity tileFromScene_;
  GltfScene scene_;
};

}  // namespace tessera
