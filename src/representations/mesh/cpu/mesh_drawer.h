// Draws contents of `mesh` on the CPU. This is the reference that every other renderer of them is compared with.
#pragma once

#include <memory>

#include "render/drawer.h"
#include "representations/mesh/content/mesh_content.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeMeshDrawer();

}  // namespace tessera
