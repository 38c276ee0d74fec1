#include "world/main_scene.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "tiles/scene_folder.h"

namespace tessera {

size_t findMainScene(const World& world) {
  const auto isMain = [](const WorldScene& scene) { return !scene.placement; };
  return static_cast<size_t>(std::find_if(world.scenes.begin(), world.scenes.end(), isMain) - world.scenes.begin());
}

std::optional<Mat4d> readSourceFromWorld(const World& world, const fs::path& worldFile) {
  const size_t number = findMainScene(world);
  const WorldScene& scene = world.scenes.at(number);
  fs::path folder;
  try {
    folder = resolveScene(worldFile, scene, fmt::format("scenes[{}]", number));
  } catch (const Error&) {
    if (scene.isVisible) throw;
    return std::nullopt;
  }
  return readTileset(folder).sourceFromWorld;
}

}  // namespace tessera
