#include "apps/tessera/render_source.h"

#include "apps/tessera/model_source.h"
#include "apps/tessera/scene_source.h"
#include "apps/tessera/world_source.h"
#include "base/error.h"
#include "world/world_file.h"

namespace tessera {
namespace {

bool holdsScene(const fs::path& folder) {
  return fs::exists(folder / "tileset.json");
}

}  // namespace

void requireSceneFor(const RenderSourceOptions& options, const fs::path& folder) {
  if (holdsScene(folder) || findWorldFile(folder) || !fs::exists(folder) ||
      (options.level == 0 && options.memoryMiB == 0))
    return;
  throw Error(folder.string(), options.level != 0 ? "--lod" : "--memory-mib", "applies to scenes, and this is none",
              "leave it out, or bake the model");
}

std::unique_ptr<RenderSource> openRenderSource(Device& device, const fs::path& folder,
                                               const RenderSourceOptions& options) {
  if (holdsScene(folder)) return openScene(device, folder, options);
  if (const std::optional<fs::path> file = findWorldFile(folder)) return openWorld(device, *file, options);
  return openModel(device, folder);
}

}  // namespace tessera
