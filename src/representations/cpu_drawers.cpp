#include "representations/cpu_drawers.h"

#include "base/check.h"
#include "render/cpu/hash_drawer.h"
#include "render/cpu/volume_drawer.h"
#include "representations/list.h"

namespace tessera {

std::unique_ptr<CpuDrawer> makeCpuDrawer(std::string_view representation) {
  std::unique_ptr<CpuDrawer> drawer;
#define SKIP(name, Name)
#define DRAWER(name, Name) \
  if (representation == #name) drawer = make##Name##Drawer();
  TESSERA_REPRESENTATIONS(SKIP, DRAWER)
#undef DRAWER
#undef SKIP
  CHECK(drawer != nullptr);
  return drawer;
}

}  // namespace tessera
