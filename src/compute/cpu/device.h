// The SIMD device: uses all cores and Highway kernels selected at run time, with the same bits for any number of
// threads.
#pragma once

#include <memory>

#include "compute/device.h"

namespace tessera {

// Uses `threads` threads; 0: all cores.
std::unique_ptr<Device> makeCpuDevice(int threads = 0);

}  // namespace tessera
