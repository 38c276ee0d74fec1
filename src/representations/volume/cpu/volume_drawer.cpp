#include "representations/volume/cpu/volume_drawer.h"

#include "raymarch/cpu/draw_scene-inl.h"
#include "raymarch/cpu/ray_marching_drawer.h"

namespace tessera {

template class RayCaster<VolumeContent>;
template RenderedView drawScene(const SceneDrawing<VolumeContent>&, const PixelDirections&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);
template RenderedView drawScene(const SceneDrawing<VolumeContent>&, const Camera&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);

std::unique_ptr<CpuDrawer> makeVolumeDrawer() {
  return std::make_unique<RayMarchingDrawer<VolumeContent>>(std::vector<std::string_view>{"distances", "none"});
}

}  // namespace tessera
