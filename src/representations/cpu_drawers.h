// The drawers on the CPU of all representations that have scenes.
#pragma once

#include "render/drawer.h"

namespace tessera {

// CHECKs that there is a representation of that name: requireCodec() says so of scenes.
std::unique_ptr<CpuDrawer> makeCpuDrawer(std::string_view representation);

}  // namespace tessera
