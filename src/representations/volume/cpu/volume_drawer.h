// Draws contents of `volume` on the CPU: the oracle that every other renderer of them is held against.
#pragma once

#include "raymarch/cpu/draw_scene.h"
#include "representations/volume/cpu/volume_shading.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeVolumeDrawer();

extern template class RayCaster<VolumeContent>;

}  // namespace tessera
