// Draws contents of `volume` on the CPU: the oracle that every other renderer of them is held against.
#pragma once

#include "render/cpu/draw_scene.h"
#include "render/cpu/volume_shading.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeVolumeDrawer();

extern template class RayCaster<VolumeContent>;

}  // namespace tessera
