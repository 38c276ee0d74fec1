#include "compute/device.h"

#include "base/error.h"

namespace tessera {

#define TESSERA_UNSUPPORTED(name)        \
  void Device::run(const name&) {        \
    CHECK(!"this device has no " #name); \
  }
TESSERA_OPERATIONS(TESSERA_UNSUPPORTED)
#undef TESSERA_UNSUPPORTED

void requireAllOperations(const Device& device) {
  for (size_t i = 0; i < std::size(kOperationNames); ++i) {
    if (device.supports(static_cast<Operation>(i))) continue;
    throw Error("--device", device.name(), "cannot train or draw yet: it has no " + std::string(kOperationNames[i]),
                "use --device cpu");
  }
}

}  // namespace tessera
