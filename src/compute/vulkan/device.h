// The GPU device: GLSL kernels on any vendor's Vulkan 1.2 driver.
#pragma once

#include <memory>

#include "compute/device.h"

namespace tessera {

class GpuContext;
struct GpuMatrices;
struct GpuOptions;

// Throws Error if there is no driver or no suitable device.
std::unique_ptr<Device> makeVulkanDevice();
std::unique_ptr<Device> makeVulkanDevice(const GpuOptions& options);
// For tests: kernels get at most three workgroups for their rows, always counted by the device if it counts the rows.
std::unique_ptr<Device> makeVulkanDeviceWithFewGroups(const GpuOptions& options);
// For tests: as above, and the kernels with cooperative matrices run on any device that supports fp16; the products are
// computed by loops, as if the device had such matrices.
std::unique_ptr<Device> makeVulkanDeviceWithEmulatedMatrices(const GpuOptions& options, const GpuMatrices& matrices);

// Returns the context of a Vulkan device, which can be shared with rendering; null for any other device.
std::shared_ptr<const GpuContext> vulkanContext(const Device& device);

// The number of batches that a Vulkan device has submitted so far, and how many of them had to be recorded
// (gpu/stream.h).
struct VulkanBatches {
  uint64_t sent = 0, recorded = 0;
};
VulkanBatches countBatches(const Device& device);

}  // namespace tessera
