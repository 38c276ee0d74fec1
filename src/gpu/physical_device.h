// Which of a machine's devices to use, and what it can do.
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
  std::string missing;  // missingIn; empty where it can be used
};

std::vector<PhysicalDevice> physicalDevices(VkInstance instance);

// `wanted` is an index, or a part of a name, any case; empty takes the best kind there is among those that can be used.
// Throws Error that lists the devices when none fits. `devices` must not be empty.
const PhysicalDevice& choosePhysicalDevice(const std::vector<PhysicalDevice>& devices, const std::string& wanted);

// Of what drivers have to have, what this one lacks: "no Vulkan 1.2". Empty where it lacks nothing.
std::string missingIn(const PhysicalDevice& device);
// Throws Error where it lacks something.
void requireFeatures(const PhysicalDevice& device);

bool hasDeviceExtension(VkPhysicalDevice device, const char* name);

// None where no shape of its matrices fits what kernels do. Vulkan 1.2 only.
GpuMatrices presentMatrices(VkPhysicalDevice device);

// What the device has of the features that have a fallback. Vulkan 1.2 only.
GpuFeatures presentFeatures(VkPhysicalDevice device);

}  // namespace tessera
