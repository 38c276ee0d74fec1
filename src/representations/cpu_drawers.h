// The CPU drawers of all representations that have scenes.
#pragma once

#include "render/drawer.h"

namespace tessera {

// Returns a CPU drawer for the named representation. CHECKs that it exists; for scenes, call requireCodec() first.
std::unique_ptr<CpuDrawer> makeCpuDrawer(std::string_view representation);

}  // namespace tessera
