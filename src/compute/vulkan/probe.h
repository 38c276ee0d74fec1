// Measures the peak rates of a GPU with dedicated kernels.
#pragma once

#include <memory>

#include "compute/device.h"
#include "compute/machine_probe.h"

namespace tessera {

// `device` must be a Vulkan device and outlive the probe.
std::unique_ptr<MachineProbe> makeVulkanProbe(Device& device);

}  // namespace tessera
