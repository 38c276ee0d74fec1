// The GPU device: GLSL kernels on any vendor's Vulkan 1.2 driver.
#pragma once

#include <memory>

#include "compute/device.h"

namespace tessera {

class GpuContext;
struct GpuMatrices;
struct GpuOptions;

// Throws Error when there is no driver or no device that fits.
std::unique_ptr<Device> makeVulkanDevice();
std::unique_ptr<Device> makeVulkanDevice(const GpuOptions& options);
// For tests: kernels get three workgroups at most for their rows, counted by the device wherever it counts rows.
std::unique_ptr<Device> makeVulkanDeviceWithFewGroups(const GpuOptions& options);
// Likewise, and the kernels of cooperative matrices run where no device has those, their products computed by loops, as
// if the device had such matrices. It has to have fp16.
std::unique_ptr<Device> makeVulkanDeviceWithEmulatedMatrices(const GpuOptions& options, const GpuMatrices& matrices);

// The context of a Vulkan device, which others may draw with; null of any other device.
std::shared_ptr<const GpuContext> contextOf(const Device& device);

// Of a Vulkan device so far: batches of work sent, and those of them that had to be recorded (gpu/stream.h).
struct VulkanBatches {
  uint64_t sent = 0, recorded = 0;
};
VulkanBatches batchesOf(const Device& device);

}  // namespace tessera
