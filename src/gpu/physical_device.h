// Selects one of the machine's Vulkan devices and queries its features.
#pragma once

#include <volk.h>

#include <string>
#include <vector>

#include "gpu/context.h"

namespace tessera {

struct PhysicalDevice {
  VkPhysicalDevice handle = VK_NULL_HANDLE;
  VkPhysicalDeviceProperties properties = {};
  std::string driver;   // "llvmpipe Mesa 22.3.6 (LLVM 15.0.6)"
  std::string missing;  // see missingIn; empty if the device can be used
};

std::vector<PhysicalDevice> physicalDevices(VkInstance instance);

// `requested` is an index or a part of a name (case-insensitive); if empty, the best kind of device among the usable
// ones is chosen. Throws Error, which lists the devices, if none matches. `devices` must not be empty.
const PhysicalDevice& choosePhysicalDevice(const std::vector<PhysicalDevice>& devices, const std::string& requested);

// Returns the first requirement that the device does not meet, for example "no Vulkan 1.2"; empty if it meets them all.
std::string missingIn(const PhysicalDevice& device);
// Throws Error if the device does not meet a requirement.
void requireFeatures(const PhysicalDevice& device);

bool hasDeviceExtension(VkPhysicalDevice device, const char* name);

// Returns the largest supported cooperative matrices that the kernels can use; Kind::none if there are none. Requires a
// device with Vulkan 1.2.
GpuMatrices presentMatrices(VkPhysicalDevice device);

// Returns the optional features that the device supports. Requires a device with Vulkan 1.2.
GpuFeatures presentFeatures(VkPhysicalDevice device);

}  // namespace tessera
