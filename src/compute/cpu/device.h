// The SIMD device: Highway kernels chosen at run time, all cores, the same bits for any number of threads.
#pragma once

#include <memory>

#include "compute/device.h"

namespace tessera {

std::unique_ptr<Device> makeCpuDevice(int threads = 0);

}  // namespace tessera
