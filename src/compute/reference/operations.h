// Every operation on float buffers in HostMemory: reads doubles, calls functions.h, stores floats.
#pragma once

#include "compute/device.h"

namespace tessera::reference {

#define TESSERA_DECLARE(name) void run(const name&);
TESSERA_OPERATIONS(TESSERA_DECLARE)
#undef TESSERA_DECLARE

}  // namespace tessera::reference
