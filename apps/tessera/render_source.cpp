#include "apps/tessera/render_source.h"

#include "apps/tessera/model_source.h"
#include "apps/tessera/scene_source.h"

namespace tessera {

std::unique_ptr<RenderSource> openRenderSource(Device& device, const fs::path& folder,
                                               const RenderSourceOptions& options) {
  if (fs::exists(folder / "tileset.json")) return openScene(device, folder, options);
  return openModel(device, folder);
}

}  // namespace tessera
