#include "gpu/call.h"

#include <fmt/format.h>

#include "base/error.h"

namespace tessera {

namespace {

struct Meaning {
  VkResult result;
  const char* name;
  const char* remedy;
};

constexpr Meaning kMeanings[] = {
    {VK_ERROR_INCOMPATIBLE_DRIVER, "no Vulkan driver is installed",
     "install mesa-vulkan-drivers or the driver of the GPU (NVIDIA's also needs libegl1 and libgl1; "
     "VK_LOADER_DEBUG=error shows why a driver does not load), or use --device cpu"},
    {VK_ERROR_INITIALIZATION_FAILED, "the driver could not start", "see what vulkaninfo says, or reinstall the driver"},
    {VK_ERROR_OUT_OF_DEVICE_MEMORY, "out of device memory",
     "train with fewer samples a step or smaller tables, render with a lower --memory-mib, or use --device cpu"},
    {VK_ERROR_OUT_OF_HOST_MEMORY, "out of memory", "close other programs, or lower --memory-mib"},
    {VK_ERROR_TOO_MANY_OBJECTS, "too many allocations", "use fewer blocks at a time"},
    {VK_ERROR_DEVICE_LOST, "the device stopped answering",
     "train: go on with --resume, from the last checkpoint; look in dmesg for the cause"},
};

}  // namespace

void checkVulkan(VkResult result, const char* call) {
  if (result >= 0) return;
  for (const Meaning& meaning : kMeanings) {
    if (meaning.result == result) throw Error("vulkan", call, meaning.name, meaning.remedy);
  }
  throw Error("vulkan", call, fmt::format("VkResult {}", static_cast<int>(result)), "update the graphics driver");
}

}  // namespace tessera
