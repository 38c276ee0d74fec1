#include <fmt/format.h>

#include "base/error.h"
#include "compute/cpu/device.h"
#include "compute/device.h"
#include "compute/reference/device.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "gpu/context.h"
#endif

namespace tessera {

namespace {

constexpr std::string_view kVulkan = "vulkan";

#ifdef TESSERA_HAS_VULKAN
// Whether a graphics card can be used; what computes on the processor anyway does not count.
bool hasGraphicsCard() {
  try {
    for (const GpuDescription& device : GpuContext::devices()) {
      if (!device.isProcessor && device.missing.empty()) return true;
    }
  } catch (const Error&) {  // no loader, no driver
  }
  return false;
}
#endif

}  // namespace

std::unique_ptr<Device> makeDevice(const DeviceOptions& options) {
  const std::string& kind = options.kind;
  if (kind == "reference") return makeReferenceDevice();
#ifdef TESSERA_HAS_VULKAN
  const bool named = kind.starts_with(std::string(kVulkan) + ":");
  if (kind == kVulkan || named || (kind == "auto" && hasGraphicsCard())) {
    GpuOptions gpu;
    if (named) gpu.device = kind.substr(kVulkan.size() + 1);
    return makeVulkanDevice(gpu);
  }
#endif
  if (kind == "cpu" || kind == "auto") return makeCpuDevice(options.threads);
  throw Error("--device " + kind, "", "there is no such device in this build",
              "use one of auto, cpu, reference, vulkan, vulkan:<index or part of a name>");
}

std::vector<DeviceDescription> listDevices() {
  std::vector<DeviceDescription> all = {{.kind = "cpu", .name = makeCpuDevice(0)->name()}};
#ifdef TESSERA_HAS_VULKAN
  try {
    const std::vector<GpuDescription> devices = GpuContext::devices();
    for (size_t i = 0; i < devices.size(); ++i) {
      const GpuDescription& device = devices[i];
      all.push_back({fmt::format("{}:{}", kVulkan, i), fmt::format("{} ({})", device.name, device.driver),
                     device.memoryBytes, device.missing});
    }
  } catch (const Error& error) {
    all.push_back({.kind = std::string(kVulkan), .missing = error.reason()});
  }
#else
  all.push_back({.kind = std::string(kVulkan), .missing = "not in this build"});
#endif
  return all;
}

}  // namespace tessera
