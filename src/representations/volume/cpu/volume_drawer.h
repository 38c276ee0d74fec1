// The CPU drawer of `volume` contents: the reference against which all other renderers of them are tested.
#pragma once

#include "raymarch/cpu/draw_scene.h"
#include "representations/volume/cpu/volume_shading.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeVolumeDrawer();

extern template class RayCaster<VolumeContent>;

}  // namespace tessera
