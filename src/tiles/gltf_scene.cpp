#include "tiles/gltf_scene.h"

#include <utility>

namespace tessera {

void GltfScene::addTo(Json& asset) const {
  for (const std::string& extension : extensionsUsed) asset["extensionsUsed"].push_back(extension);
  asset["scenes"][0]["nodes"] = {nodes.size()};
  Json turned = {{"children", roots}};
  turned["matrix"] = {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1};  // column-major
  asset["nodes"] = nodes;
  asset["nodes"].push_back(std::move(turned));
  const std::pair<const char*, const Json&> members[] = {{"meshes", meshes},       {"accessors", accessors},
                                                         {"materials", materials}, {"textures", textures},
                                                         {"images", images},       {"samplers", samplers}};
  for (const auto& [key, member] : members) {
    if (!member.empty()) asset[key] = member;
  }
}

}  // namespace tessera
