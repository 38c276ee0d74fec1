// Reads glTF and GLB models from arbitrary bytes: what is accepted can be drawn.
#include <cstdlib>

#include "base/error.h"
#include "world/model.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto reader = [&](const std::string& path) -> std::optional<tessera::Bytes> {
    if (path != "model.gltf") return std::nullopt;
    const auto* bytes = reinterpret_cast<const std::byte*>(data);
    return tessera::Bytes(bytes, bytes + size);
  };
  try {
    const tessera::Model model =
        tessera::readModel("model.gltf", reader, {.triangles = 100'000, .texturePixels = 1 << 20});
    if (model.corners.empty() || model.corners.size() % 3 != 0) std::abort();
    for (const uint32_t corner : model.corners)
      if (corner >= model.vertices.size()) std::abort();
    for (const tessera::ModelVertex& vertex : model.vertices) {
      if (!vertex.position.allFinite() || !vertex.normal.allFinite()) std::abort();
      if (vertex.material >= model.materials.size()) std::abort();
    }
    const int textures = static_cast<int>(model.textures.size());
    for (const tessera::ModelMaterial& material : model.materials) {
      for (const int texture : {material.texture, material.surfaceTexture, material.emissionTexture})
        if (texture < -1 || texture >= textures) std::abort();
    }
  } catch (const tessera::Error&) {
  }
  return 0;
}
