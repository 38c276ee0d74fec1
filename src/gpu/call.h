// Calls to Vulkan: their arguments begin empty, their results are never ignored.
#pragma once

#include <volk.h>

namespace tessera {

// Throws Error naming `call`, the code, and what a person can do about it. VK_SUCCESS and positive codes pass.
void checkVulkan(VkResult result, const char* call);

// A Vulkan struct that knows its type and has zeros everywhere else.
template <class T>
T vulkanStruct(VkStructureType type) {
  T empty = {};
  empty.sType = type;
  return empty;
}

}  // namespace tessera
