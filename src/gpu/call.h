// Helpers for Vulkan calls: zero-initialised structs, and results that are always checked.
#pragma once

#include <volk.h>

namespace tessera {

// Throws Error if `result` is negative. The error names `call`, the code and a remedy. VK_SUCCESS and positive codes
// are accepted.
void checkVulkan(VkResult result, const char* call);

// Returns a Vulkan struct with sType set to `type` and all other members zero.
template <class T>
T vulkanStruct(VkStructureType type) {
  T empty = {};
  empty.sType = type;
  return empty;
}

}  // namespace tessera
