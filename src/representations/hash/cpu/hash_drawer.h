// Draws contents of `hash` on the CPU. This is the reference that every other renderer of them is compared with.
#pragma once

#include "raymarch/cpu/draw_scene.h"
#include "representations/hash/cpu/hash_shading.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeHashDrawer();

extern template class RayCaster<HashContent>;

}  // namespace tessera
