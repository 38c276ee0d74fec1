#include "gpu/physical_device.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"

namespace tessera {

namespace {

std::string lowerCase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

int rank(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return 4;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return 3;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return 2;
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return 1;
    default:
      return 0;
  }
}

}  // namespace

bool hasDeviceExtension(VkPhysicalDevice device, const char* name) {
  uint32_t count = 0;
  checkVulkan(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr),
              "vkEnumerateDeviceExtensionProperties");
  std::vector<VkExtensionProperties> extensions(count);
  checkVulkan(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()),
              "vkEnumerateDeviceExtensionProperties");
  return std::any_of(extensions.begin(), extensions.end(),
                     [&](const VkExtensionProperties& e) { return std::strcmp(e.extensionName, name) == 0; });
}

std::vector<PhysicalDevice> physicalDevices(VkInstance instance) {
  uint32_t count = 0;
  checkVulkan(vkEnumeratePhysicalDevices(instance, &count, nullptr), "vkEnumeratePhysicalDevices");
  std::vector<VkPhysicalDevice> handles(count);
  checkVulkan(vkEnumeratePhysicalDevices(instance, &count, handles.data()), "vkEnumeratePhysicalDevices");
  std::vector<PhysicalDevice> devices;
  for (VkPhysicalDevice handle : handles) {
    PhysicalDevice& device = devices.emplace_back();
    device.handle = handle;
    vkGetPhysicalDeviceProperties(handle, &device.properties);
    device.driver = fmt::format("driver {:#x}", device.properties.driverVersion);
    device.missing = missingIn(device);
    if (device.properties.apiVersion < VK_API_VERSION_1_2) continue;
    auto driver = vulkanStruct<VkPhysicalDeviceDriverProperties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES);
    auto properties = vulkanStruct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
    properties.pNext = &driver;
    vkGetPhysicalDeviceProperties2(handle, &properties);
    device.driver = fmt::format("{} {}", driver.driverName, driver.driverInfo);
  }
  return devices;
}

const PhysicalDevice& choosePhysicalDevice(const std::vector<PhysicalDevice>& devices, const std::string& requested) {
  CHECK(!devices.empty());
  if (requested.empty()) {
    return *std::max_element(devices.begin(), devices.end(), [](const PhysicalDevice& a, const PhysicalDevice& b) {
      const auto worth = [](const PhysicalDevice& d) {
        return rank(d.properties.deviceType) + (d.missing.empty() ? 10 : 0);
      };
      return worth(a) < worth(b);
    });
  }
  std::string list;
  for (size_t i = 0; i < devices.size(); ++i) {
    if (std::to_string(i) == requested) return devices[i];
  }
  for (size_t i = 0; i < devices.size(); ++i) {
    const std::string name = devices[i].properties.deviceName;
    if (lowerCase(name).find(lowerCase(requested)) != std::string::npos) return devices[i];
    list += fmt::format("{}{} {}", i ? ", " : "", i, name);
  }
  throw Error("Vulkan device \"" + requested + "\"", "", "there is no such device", "choose one of: " + list);
}

std::string missingIn(const PhysicalDevice& device) {
  if (device.properties.apiVersion < VK_API_VERSION_1_2) return "no Vulkan 1.2";
  auto vulkan12 = vulkanStruct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  auto features = vulkanStruct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  features.pNext = &vulkan12;
  vkGetPhysicalDeviceFeatures2(device.handle, &features);
  if (!vulkan12.bufferDeviceAddress) return "no buffer device addresses";
  if (!vulkan12.timelineSemaphore) return "no timeline semaphores";
  const VkPhysicalDeviceLimits& limits = device.properties.limits;
  if (limits.maxComputeWorkGroupInvocations < 256 || limits.maxComputeWorkGroupSize[0] < 256) {
    return "no workgroups of 256";
  }
  if (limits.maxComputeSharedMemorySize < 32768) return "no 32 KiB of shared memory";
  return {};
}

void requireFeatures(const PhysicalDevice& device) {
  const std::string missing = missingIn(device);
  if (missing.empty()) return;
  throw Error(device.properties.deviceName, "", "its driver has " + missing,
              "update the graphics driver, choose another device (tessera info devices), or use --device cpu");
}

namespace {

// Returns the size of full subgroups that compute kernels can require; 0 if they cannot require any.
uint32_t settledSubgroupSize(VkPhysicalDevice device) {
  if (!hasDeviceExtension(device, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME)) return 0;
  auto control = vulkanStruct<VkPhysicalDeviceSubgroupSizeControlFeaturesEXT>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES_EXT);
  auto features = vulkanStruct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  features.pNext = &control;
  vkGetPhysicalDeviceFeatures2(device, &features);
  if (!control.subgroupSizeControl || !control.computeFullSubgroups) return 0;
  auto sizes = vulkanStruct<VkPhysicalDeviceSubgroupSizeControlPropertiesEXT>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_PROPERTIES_EXT);
  auto subgroup =
      vulkanStruct<VkPhysicalDeviceSubgroupProperties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES);
  auto properties = vulkanStruct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  properties.pNext = &sizes;
  sizes.pNext = &subgroup;
  vkGetPhysicalDeviceProperties2(device, &properties);
  if (!(sizes.requiredSubgroupSizeStages & VK_SHADER_STAGE_COMPUTE_BIT)) return 0;
  const uint32_t size = std::clamp(subgroup.subgroupSize, sizes.minSubgroupSize, sizes.maxSubgroupSize);
  const uint32_t most = std::min(GpuMatrices::kMaxThreads, properties.properties.limits.maxComputeWorkGroupInvocations);
  return GpuMatrices::kSubgroups * size <= most ? size : 0;
}

// Both extensions describe matrices in the same way with different names.
template <class Shape>
bool fits(const Shape& shape, uint32_t rows, uint32_t columns, uint32_t depth) {
  return 16 % rows == 0 && 16 % columns == 0 && 16 % depth == 0 &&
         static_cast<int>(shape.scope) == VK_SCOPE_SUBGROUP_NV;
}

template <class Features>
bool knowsMatrices(VkPhysicalDevice device, VkStructureType type) {
  auto matrices = vulkanStruct<Features>(type);
  auto vulkan12 = vulkanStruct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  auto features = vulkanStruct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  features.pNext = &vulkan12;
  vulkan12.pNext = &matrices;
  vkGetPhysicalDeviceFeatures2(device, &features);
  return matrices.cooperativeMatrix && vulkan12.vulkanMemoryModel;
}

template <class Shape, class List>
std::vector<Shape> queryShapes(VkPhysicalDevice device, VkStructureType type, List list) {
  uint32_t count = 0;
  checkVulkan(list(device, &count, nullptr), "vkGetPhysicalDeviceCooperativeMatrixProperties");
  std::vector<Shape> shapes(count, vulkanStruct<Shape>(type));
  checkVulkan(list(device, &count, shapes.data()), "vkGetPhysicalDeviceCooperativeMatrixProperties");
  return shapes;
}

// Replaces `best` if the product of the given matrices is larger.
void consider(GpuMatrices& best, GpuMatrices::Kind kind, uint32_t rows, uint32_t columns, uint32_t depth) {
  const bool isFirst = best.kind == GpuMatrices::Kind::none;
  if (isFirst || rows * columns * depth > best.rows * best.columns * best.depth) {
    best = {kind, rows, columns, depth, best.subgroupSize};
  }
}

}  // namespace

GpuMatrices presentMatrices(VkPhysicalDevice device) {
  GpuMatrices best;
  best.subgroupSize = settledSubgroupSize(device);
  if (best.subgroupSize == 0) return best;
#ifdef TESSERA_KHR_MATRICES
  if (hasDeviceExtension(device, VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME) &&
      knowsMatrices<VkPhysicalDeviceCooperativeMatrixFeaturesKHR>(
          device, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_KHR)) {
    const auto shapes = queryShapes<VkCooperativeMatrixPropertiesKHR>(
        device, VK_STRUCTURE_TYPE_COOPERATIVE_MATRIX_PROPERTIES_KHR, vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR);
    // Sums are converted to fp16 as whole matrices, so fp16 accumulators of the same size must exist.
    const auto halvesLike = [&](const VkCooperativeMatrixPropertiesKHR& sums) {
      return std::any_of(shapes.begin(), shapes.end(), [&](const VkCooperativeMatrixPropertiesKHR& s) {
        return s.MSize == sums.MSize && s.NSize == sums.NSize && s.ResultType == VK_COMPONENT_TYPE_FLOAT16_KHR;
      });
    };
    for (const auto& s : shapes) {
      if (fits(s, s.MSize, s.NSize, s.KSize) && s.AType == VK_COMPONENT_TYPE_FLOAT16_KHR &&
          s.BType == VK_COMPONENT_TYPE_FLOAT16_KHR && s.CType == VK_COMPONENT_TYPE_FLOAT32_KHR &&
          s.ResultType == VK_COMPONENT_TYPE_FLOAT32_KHR && !s.saturatingAccumulation && halvesLike(s)) {
        consider(best, GpuMatrices::Kind::khr, s.MSize, s.NSize, s.KSize);
      }
    }
    if (best.kind != GpuMatrices::Kind::none) return best;
  }
#endif
  if (!hasDeviceExtension(device, VK_NV_COOPERATIVE_MATRIX_EXTENSION_NAME) ||
      !knowsMatrices<VkPhysicalDeviceCooperativeMatrixFeaturesNV>(
          device, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_NV)) {
    return best;
  }
  for (const auto& s :
       queryShapes<VkCooperativeMatrixPropertiesNV>(device, VK_STRUCTURE_TYPE_COOPERATIVE_MATRIX_PROPERTIES_NV,
                                                    vkGetPhysicalDeviceCooperativeMatrixPropertiesNV)) {
    if (fits(s, s.MSize, s.NSize, s.KSize) && s.AType == VK_COMPONENT_TYPE_FLOAT16_NV &&
        s.BType == VK_COMPONENT_TYPE_FLOAT16_NV && s.CType == VK_COMPONENT_TYPE_FLOAT32_NV &&
        s.DType == VK_COMPONENT_TYPE_FLOAT32_NV) {
      consider(best, GpuMatrices::Kind::nv, s.MSize, s.NSize, s.KSize);
    }
  }
  return best;
}

GpuFeatures presentFeatures(VkPhysicalDevice device) {
  auto atomics = vulkanStruct<VkPhysicalDeviceShaderAtomicFloatFeaturesEXT>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_FEATURES_EXT);
  auto vulkan12 = vulkanStruct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  auto vulkan11 = vulkanStruct<VkPhysicalDeviceVulkan11Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES);
  auto features = vulkanStruct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  features.pNext = &vulkan11;
  vulkan11.pNext = &vulkan12;
  if (hasDeviceExtension(device, VK_EXT_SHADER_ATOMIC_FLOAT_EXTENSION_NAME)) vulkan12.pNext = &atomics;
  vkGetPhysicalDeviceFeatures2(device, &features);

  auto subgroup =
      vulkanStruct<VkPhysicalDeviceSubgroupProperties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES);
  auto properties = vulkanStruct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  properties.pNext = &subgroup;
  vkGetPhysicalDeviceProperties2(device, &properties);

  GpuFeatures present;
  present.floatAtomics = atomics.shaderBufferFloat32AtomicAdd;
  present.float64 = features.features.shaderFloat64;
  present.float16 = vulkan12.shaderFloat16 && vulkan11.storageBuffer16BitAccess;
  present.subgroups = (subgroup.supportedStages & VK_SHADER_STAGE_COMPUTE_BIT) &&
                      (subgroup.supportedOperations & VK_SUBGROUP_FEATURE_ARITHMETIC_BIT);
  present.matrices = presentMatrices(device).kind != GpuMatrices::Kind::none;
  return present;
}

}  // namespace tessera
