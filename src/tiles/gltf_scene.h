// The scene of a glTF 2.0 asset: what programs draw of the contents and exports that are written here.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tessera {

// Constants of glTF, which are those of OpenGL: targets of buffer views and types of components.
inline constexpr uint32_t kGltfVertices = 34962, kGltfIndices = 34963;
inline constexpr uint32_t kGltfFloat = 5126, kGltfUnsignedInt = 5125;

// Arrays of the asset, each empty if unused. Accessors and images refer to buffer views by their indices.
struct GltfScene {
  using Json = nlohmann::ordered_json;

  Json accessors = Json::array(), meshes = Json::array(), materials = Json::array();
  Json textures = Json::array(), images = Json::array(), samplers = Json::array();
  // In Z-up coordinates, for example of the tile frame. Since glTF is Y-up, addTo() puts a node above `roots` that maps
  // (x, y, z) to (x, z, -y).
  Json nodes = Json::array();
  std::vector<size_t> roots;                // indices into `nodes`
  std::vector<std::string> extensionsUsed;  // by the members above, for example "KHR_materials_unlit"

  bool isEmpty() const { return nodes.empty(); }
  // Adds the arrays to an asset whose `extensionsUsed` is an array or absent. Empty arrays are left out, because glTF
  // forbids them.
  void addTo(Json& asset) const;
};

}  // namespace tessera
