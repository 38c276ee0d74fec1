#include "representations/gpu_drawers.h"

#include "base/check.h"
#include "representations/codecs.h"
#include "representations/list.h"
#include "tiles/scene_folder.h"

namespace tessera {

#define SKIP(name, Name)
#define DRAWER(name, Name) std::unique_ptr<GpuDrawer> makeGpu##Name##Drawer(const std::shared_ptr<GpuStream>& stream);
TESSERA_REPRESENTATIONS(SKIP, DRAWER)
#undef DRAWER

std::unique_ptr<GpuDrawer> makeGpuDrawer(std::string_view representation, const std::shared_ptr<GpuStream>& stream) {
  std::unique_ptr<GpuDrawer> drawer;
#define DRAWER(name, Name) \
  if (representation == #name) drawer = makeGpu##Name##Drawer(stream);
  TESSERA_REPRESENTATIONS(SKIP, DRAWER)
#undef DRAWER
  CHECK(drawer != nullptr);
  return drawer;
}

std::unique_ptr<GpuSceneRenderer> openGpuScene(const std::shared_ptr<const GpuContext>& context, const fs::path& folder,
                                               const GpuRendererSettings& settings) {
  const Tileset tileset = readTileset(folder);
  const ContentCodec& codec = requireCodec(folder, tileset);
  const auto stream = std::make_shared<GpuStream>(context);
  return std::make_unique<GpuSceneRenderer>(stream, makeGpuDrawer(tileset.representation, stream),
                                            openTileScene(folder, codec), settings);
}

}  // namespace tessera
