#include "representations/hash/cpu/hash_drawer.h"

#include "raymarch/cpu/draw_scene-inl.h"
#include "raymarch/cpu/ray_marching_drawer.h"

namespace tessera {

template class RayCaster<HashContent>;
template RenderedView drawScene(const SceneDrawing<HashContent>&, const PixelDirections&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);
template RenderedView drawScene(const SceneDrawing<HashContent>&, const Camera&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);

std::unique_ptr<CpuDrawer> makeHashDrawer() {
  return std::make_unique<RayMarchingDrawer<HashContent>>(std::vector<std::string_view>{"distances", "cells", "none"});
}

}  // namespace tessera
