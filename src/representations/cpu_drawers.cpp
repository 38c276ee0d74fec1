#include "representations/cpu_drawers.h"

#include "base/check.h"
#include "representations/list.h"

namespace tessera {

#define SKIP(name, Name)
#define DRAWER(name, Name) std::unique_ptr<CpuDrawer> make##Name##Drawer();
TESSERA_REPRESENTATIONS(SKIP, DRAWER)
#undef DRAWER

std::unique_ptr<CpuDrawer> makeCpuDrawer(std::string_view representation) {
  std::unique_ptr<CpuDrawer> drawer;
#define DRAWER(name, Name) \
  if (representation == #name) drawer = make##Name##Drawer();
  TESSERA_REPRESENTATIONS(SKIP, DRAWER)
#undef DRAWER
  CHECK(drawer != nullptr);
  return drawer;
}

}  // namespace tessera
