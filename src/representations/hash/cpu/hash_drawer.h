// Draws contents of `hash` on the CPU: the oracle that every other renderer of them is held against.
#pragma once

#include "raymarch/cpu/draw_scene.h"
#include "representations/hash/cpu/hash_shading.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeHashDrawer();

extern template class RayCaster<HashContent>;

}  // namespace tessera
