// The GPU device: GLSL kernels on any vendor's Vulkan 1.2 driver.
#pragma once

#include <memory>

#include "compute/device.h"

namespace tessera {

struct GpuOptions;

// Throws Error when there is no driver or no device that fits.
std::unique_ptr<Device> makeVulkanDevice();
std::unique_ptr<Device> makeVulkanDevice(const GpuOptions& options);

}  // namespace tessera
