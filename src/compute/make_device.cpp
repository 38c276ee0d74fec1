#include "base/error.h"
#include "compute/cpu/device.h"
#include "compute/device.h"
#include "compute/reference/device.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#endif

namespace tessera {

std::unique_ptr<Device> makeDevice(const DeviceOptions& options) {
  if (options.kind == "cpu" || options.kind == "auto") return makeCpuDevice(options.threads);
  if (options.kind == "reference") return makeReferenceDevice();
#ifdef TESSERA_HAS_VULKAN
  if (options.kind == "vulkan") return makeVulkanDevice();
#endif
  throw Error("--device " + options.kind, "", "there is no such device in this build",
              "use one of auto, cpu, reference, vulkan");
}

}  // namespace tessera
