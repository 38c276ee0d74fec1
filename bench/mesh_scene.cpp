#include "bench/mesh_scene.h"

#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/cpu/mesh_drawer.h"

namespace tessera {

ChangedMeshDrawer::ChangedMeshDrawer() : drawer_(makeMeshDrawer()) {}

OpenedMeshScene openMeshScene(const fs::path& folder, std::unique_ptr<CpuDrawer> drawer,
                              double maximumScreenSpaceError) {
  TileScene scene = openTileScene(folder, meshCodec());
  SceneRendererSettings settings;
  settings.selection.maximumScreenSpaceError = maximumScreenSpaceError;
  settings.budgetBytes = uint64_t{8} << 30;
  settings.background = Eigen::Array3f(scene.background[0], scene.background[1], scene.background[2]);
  OpenedMeshScene opened{scene.frame, scene.tree, nullptr};
  opened.renderer = std::make_unique<SceneRenderer>(std::move(drawer), scene.frame, std::move(scene.tree),
                                                    std::move(scene.source), settings);
  return opened;
}

}  // namespace tessera
