// Draws contents of `hash` on the CPU: the oracle that every other renderer of them is held against.
#pragma once

#include "render/cpu/draw_scene.h"
#include "render/cpu/hash_shading.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeHashDrawer();

extern template class RayCaster<HashContent>;

}  // namespace tessera
