// Decodes worlds from arbitrary text: an accepted world has finite placements and a main scene.
#include <algorithm>
#include <cstdlib>

#include "base/error.h"
#include "world/world_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    const tessera::World world = tessera::decodeWorld({reinterpret_cast<const char*>(data), size}, "world.json");
    const auto isMain = [](const tessera::WorldScene& scene) { return !scene.placement; };
    if (std::none_of(world.scenes.begin(), world.scenes.end(), isMain)) std::abort();
    for (const tessera::WorldScene& scene : world.scenes) {
      if (scene.placement && !(scene.placement->scale > 0 && scene.placement->rotation.allFinite())) std::abort();
    }
    for (const tessera::WorldModel& model : world.models) {
      if (model.files.empty() || !model.position.allFinite() || !(model.scale.minCoeff() > 0)) std::abort();
    }
    for (const tessera::Bookmark& bookmark : world.bookmarks) {
      if (!bookmark.eye.allFinite() || !bookmark.target.allFinite()) std::abort();
    }
  } catch (const tessera::Error&) {
  }
  return 0;
}
