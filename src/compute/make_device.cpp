#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <thread>

#include "base/error.h"
#include "base/log.h"
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
// The index of the best usable GPU, ignoring Vulkan drivers that compute on the CPU.
std::optional<size_t> findGpu() {
  std::optional<size_t> best;
  try {
    const std::vector<GpuDescription> devices = GpuContext::devices();
    for (size_t i = 0; i < devices.size(); ++i) {
      if (devices[i].isCpu || !devices[i].missing.empty()) continue;
      if (!best || (devices[i].isDiscrete && !devices[*best].isDiscrete)) best = i;
    }
  } catch (const Error&) {  // there is no Vulkan loader or no driver
  }
  return best;
}
#endif

}  // namespace

std::optional<std::string> parseVulkanDevice([[maybe_unused]] const std::string& kind) {
#ifdef TESSERA_HAS_VULKAN
  if (kind == kVulkan) return "";
  if (kind.starts_with(std::string(kVulkan) + ":")) return kind.substr(kVulkan.size() + 1);
  if (kind == "auto") {
    if (const std::optional<size_t> gpu = findGpu()) return std::to_string(*gpu);
  }
#endif
  return std::nullopt;
}

namespace {

std::unique_ptr<Device> makeDeviceOfKind(const DeviceOptions& options) {
  const std::string& kind = options.kind;
  if (kind == "reference") return makeReferenceDevice();
#ifdef TESSERA_HAS_VULKAN
  if (const std::optional<std::string> device = parseVulkanDevice(kind)) {
    GpuOptions gpu;
    gpu.device = *device;
    try {
      return makeVulkanDevice(gpu);
    } catch (const Error& error) {
      if (kind != "auto") throw;
      warn("{}; continuing on the CPU", error.what());
    }
  }
#endif
  if (kind == "cpu" || kind == "auto") return makeCpuDevice(options.threads);
  throw Error("--device " + kind, "", "there is no such device in this build",
              "use one of auto, cpu, reference, vulkan, vulkan:<index or part of a name>");
}

}  // namespace

std::unique_ptr<Device> makeDevice(const DeviceOptions& options) {
  constexpr int kMaxHostThreads = 8;  // enough, since the host work takes 1 to 2 ms on a single thread
  std::unique_ptr<Device> device = makeDeviceOfKind(options);
  const int threads = options.threads > 0 ? options.threads : static_cast<int>(std::thread::hardware_concurrency());
  device->setHostThreads(std::clamp(threads, 1, kMaxHostThreads));
  return device;
}

std::vector<DeviceDescription> listDevices() {
  std::vector<DeviceDescription> all = {{.kind = "cpu", .name = makeCpuDevice(0)->name()}};
#ifdef TESSERA_HAS_VULKAN
  try {
    const std::vector<GpuDescription> devices = GpuContext::devices();
    for (size_t i = 0; i < devices.size(); ++i) {
      const GpuDescription& device = devices[i];
      DeviceDescription& description = all.emplace_back();
      description = {fmt::format("{}:{}", kVulkan, i), fmt::format("{} ({})", device.name, device.driver),
                     device.memoryBytes, device.missing};
      for (const auto& [name, feature] : kGpuFeatureNames) {
        if (device.missing.empty() && device.features.*feature) description.features.emplace_back(name);
      }
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
