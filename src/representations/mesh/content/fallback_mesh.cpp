#include "representations/mesh/content/fallback_mesh.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace tessera {
namespace {

// Constants of glTF, which are those of OpenGL.
constexpr uint32_t kTriangles = 4;
constexpr uint32_t kLinear = 9729, kClampToEdge = 33071;
constexpr const char* kUnlit = "KHR_materials_unlit";

}  // namespace

OrdinaryTriangles makeOrdinaryTriangles(const PatchSet& part, const Similarity& frameFromScene) {
  OrdinaryTriangles triangles;
  if (part.patches == 0) return triangles;
  triangles.middle = frameFromScene * part.corner(0, 0);
  const uint32_t across = part.patchesAcross(), edge = part.patchEdge;
  for (uint32_t patch = 0; patch < part.patches; ++patch) {
    for (uint32_t number = 0; number < 4; ++number) {
      const bool isUsed = number < 3 || patch < part.pairs;
      const Vec3f at = (frameFromScene * part.corner(patch, isUsed ? number : 0) - triangles.middle).cast<float>();
      triangles.positions.insert(triangles.positions.end(), at.begin(), at.end());
      const double column = patch % across * edge + (number & 1) * (edge - 1) + 0.5,
                   row = patch / across * edge + (number >> 1) * (edge - 1) + 0.5;
      triangles.places.push_back(static_cast<float>(column / part.textureWidth()));
      triangles.places.push_back(static_cast<float>(row / part.textureHeight()));
    }
    for (const uint32_t corner : {0u, 1u, 2u}) triangles.corners.push_back(4 * patch + corner);
    if (patch < part.pairs)
      for (const uint32_t corner : {3u, 2u, 1u}) triangles.corners.push_back(4 * patch + corner);
  }
  return triangles;
}

GltfScene::Json pngAt(const std::string& uri) {
  return {{"uri", uri}, {"mimeType", "image/png"}};
}

size_t FallbackMesh::addAccessor(std::span<const std::byte> bytes, uint32_t target, uint32_t componentType,
                                 size_t count, const char* type) {
  scene_.accessors.push_back(
      {{"bufferView", addView_(bytes, target)}, {"componentType", componentType}, {"count", count}, {"type", type}});
  return scene_.accessors.size() - 1;
}

size_t FallbackMesh::addMaterial(const GltfScene::Json& image) {
  if (scene_.samplers.empty()) {
    // Without mipmaps, which would mix neighbouring patches.
    scene_.samplers.push_back(
        {{"magFilter", kLinear}, {"minFilter", kLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}});
    scene_.extensionsUsed.push_back(kUnlit);
  }
  scene_.images.push_back(image);
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

void FallbackMesh::add(const PatchSet& part, const GltfScene::Json& image, const std::string& name) {
  if (part.patches == 0) return;
  const OrdinaryTriangles triangles = makeOrdinaryTriangles(part, tileFromScene_);
  Vec3f low = Vec3f::Constant(INFINITY), high = Vec3f::Constant(-INFINITY);
  for (size_t at = 0; at < triangles.positions.size(); at += 3) {
    const Eigen::Map<const Vec3f> position(&triangles.positions[at]);
    low = low.cwiseMin(position);
    high = high.cwiseMax(position);
  }
  const size_t vertices = triangles.positions.size() / 3;
  const size_t position =
      addAccessor(std::as_bytes(std::span(triangles.positions)), kGltfVertices, kGltfFloat, vertices, "VEC3");
  scene_.accessors[position]["min"] = {low.x(), low.y(), low.z()};
  scene_.accessors[position]["max"] = {high.x(), high.y(), high.z()};
  GltfScene::Json primitive;
  primitive["attributes"]["POSITION"] = position;
  primitive["attributes"]["TEXCOORD_0"] =
      addAccessor(std::as_bytes(std::span(triangles.places)), kGltfVertices, kGltfFloat, vertices, "VEC2");
  primitive["indices"] = addAccessor(std::as_bytes(std::span(triangles.corners)), kGltfIndices, kGltfUnsignedInt,
                                     triangles.corners.size(), "SCALAR");
  primitive["mode"] = kTriangles;
  if (!image.is_null()) primitive["material"] = addMaterial(image);
  GltfScene::Json mesh;
  mesh["primitives"].push_back(primitive);
  GltfScene::Json node;
  if (!name.empty()) mesh["name"] = node["name"] = name;
  scene_.meshes.push_back(mesh);
  node["mesh"] = scene_.meshes.size() - 1;
  node["translation"] = {triangles.middle.x(), triangles.middle.y(), triangles.middle.z()};
  scene_.nodes.push_back(node);
  scene_.roots.push_back(scene_.nodes.size() - 1);
}

}  // namespace tessera
