// What a graphics card could do at best, measured by kernels that do nothing else.
#pragma once

#include <memory>

#include "compute/device.h"
#include "compute/machine_probe.h"

namespace tessera {

// `device` is a Vulkan device and outlives it.
std::unique_ptr<MachineProbe> makeVulkanProbe(Device& device);

}  // namespace tessera
