#include "representations/mesh/content/fallback_mesh.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace tessera {
namespace {

// Constants of glTF, which are those of OpenGL.
constexpr uint32_t kVertices = 34962, kIndices = 34963, kFloat = 5126, kUnsignedInt = 5125, kTriangles = 4;
constexpr uint32_t kLinear = 9729, kClampToEdge = 33071;
constexpr const char* kUnlit = "KHR_materials_unlit";

}  // namespace

size_t FallbackMesh::addAccessor(std::span<const std::byte> bytes, uint32_t target, uint32_t componentType,
                                 size_t count, const char* type) {
  scene_.accessors.push_back({{"bufferView", file_.addView(bytes, target)},
                              {"componentType", componentType},
                              {"count", count},
                              {"type", type}});
  return scene_.accessors.size() - 1;
}

size_t FallbackMesh::addMaterial(const std::string& textureUri) {
  if (scene_.samplers.empty()) {
    // Without mipmaps, which would mix neighbouring patches.
    scene_.samplers.push_back(
        {{"magFilter", kLinear}, {"minFilter", kLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}});
    scene_.extensionsUsed.push_back(kUnlit);
  }
  scene_.images.push_back({{"uri", textureUri}, {"mimeType", "image/png"}});
  scene_.textures.push_back({{"sampler", 0}, {"source", scene_.images.size() - 1}});
  GltfScene::Json material;
  material["pbrMetallicRoughness"]["baseColorTexture"]["index"] = scene_.textures.size() - 1;
  material["pbrMetallicRoughness"]["metallicFactor"] = 0;
  material["alphaMode"] = "MASK";
  material["alphaCutoff"] = kFallbackAlphaCutoff;
  material["doubleSided"] = true;
  material["extensions"][kUnlit] = GltfScene::Json::object();
  scene_.materials.push_back(material);
  return scene_.materials.size() - 1;
}

void FallbackMesh::add(const PatchSet& part, const std::string& textureUri) {
  if (part.patches == 0) return;
  // Positions are relative to a node, so that floats are precise enough.
  const Vec3d middle = tileFromScene_ * part.corner(0, 0);
  std::vector<float> positions, places;
  Vec3f low = Vec3f::Constant(INFINITY), high = Vec3f::Constant(-INFINITY);
  const uint32_t across = part.patchesAcross(), edge = part.patchEdge;
  for (uint32_t patch = 0; patch < part.patches; ++patch) {
    for (uint32_t number = 0; number < 4; ++number) {
      const Vec3f at = (tileFromScene_ * part.corner(patch, number) - middle).cast<float>();
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
      positions.insert(positions.end(), at.begin(), at.end());
      const double column = patch % across * edge + (number & 1) * (edge - 1) + 0.5,
                   row = patch / across * edge + (number >> 1) * (edge - 1) + 0.5;
      places.push_back(static_cast<float>(column / part.textureWidth()));
      places.push_back(static_cast<float>(row / part.textureHeight()));
    }
  }
  std::vector<uint32_t> corners;
  for (uint32_t patch = 0; patch < part.patches; ++patch) {
    for (const uint32_t corner : {0u, 1u, 2u}) corners.push_back(4 * patch + corner);
    if (patch < part.pairs)
      for (const uint32_t corner : {3u, 2u, 1u}) corners.push_back(4 * patch + corner);
  }
  const size_t vertices = size_t{4} * part.patches;
  const size_t position = addAccessor(std::as_bytes(std::span(positions)), kVertices, kFloat, vertices, "VEC3");
  scene_.accessors[position]["min"] = {low.x(), low.y(), low.z()};
  scene_.accessors[position]["max"] = {high.x(), high.y(), high.z()};
  GltfScene::Json primitive;
  primitive["attributes"]["POSITION"] = position;
  primitive["attributes"]["TEXCOORD_0"] =
      addAccessor(std::as_bytes(std::span(places)), kVertices, kFloat, vertices, "VEC2");
  primitive["indices"] =
      addAccessor(std::as_bytes(std::span(corners)), kIndices, kUnsignedInt, corners.size(), "SCALAR");
  primitive["mode"] = kTriangles;
  primitive["material"] = addMaterial(textureUri);
  GltfScene::Json mesh;
  mesh["primitives"].push_back(primitive);
  scene_.meshes.push_back(mesh);
  GltfScene::Json node;
  node["mesh"] = scene_.meshes.size() - 1;
  node["translation"] = {middle.x(), middle.y(), middle.z()};
  scene_.nodes.push_back(node);
  scene_.roots.push_back(scene_.nodes.size() - 1);
}

}  // namespace tessera
