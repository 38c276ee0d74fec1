#include "compute/device.h"

namespace tessera {

#define TESSERA_UNSUPPORTED(name) \
  void Device::run(const name&) { CHECK(!"this device has no " #name); }
TESSERA_OPERATIONS(TESSERA_UNSUPPORTED)
#undef TESSERA_UNSUPPORTED

}  // namespace tessera
