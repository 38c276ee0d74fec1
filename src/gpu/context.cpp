#include "gpu/context.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"
#include "gpu/heap.h"
#include "gpu/physical_device.h"
#include "gpu/pipeline_cache.h"
#include "gpu/validation.h"

namespace tessera {

namespace {

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

// Loads the Vulkan loader at first use: on a machine without one, the same program trains on the CPU.
void openLoader() {
  static const VkResult result = volkInitialize();
  if (result != VK_SUCCESS) {
    throw Error("vulkan", "libvulkan.so.1", "no Vulkan loader is installed",
                "install libvulkan1 and a driver (mesa-vulkan-drivers or that of the GPU), or use --device cpu");
  }
}

// Returns all available surface extensions: which one is needed is only known when a window is opened.
std::vector<const char*> surfaceExtensions() {
  uint32_t count = 0;
  checkVulkan(vkEnumerateInstanceExtensionProperties(nullptr, &count, nullptr),
              "vkEnumerateInstanceExtensionProperties");
  std::vector<VkExtensionProperties> present(count);
  checkVulkan(vkEnumerateInstanceExtensionProperties(nullptr, &count, present.data()),
              "vkEnumerateInstanceExtensionProperties");
  std::vector<const char*> names;
  for (const char* name : {"VK_KHR_surface", "VK_KHR_xcb_surface", "VK_KHR_xlib_surface", "VK_KHR_wayland_surface"}) {
    const auto isNamed = [&](const VkExtensionProperties& one) { return std::strcmp(one.extensionName, name) == 0; };
    if (std::any_of(present.begin(), present.end(), isNamed)) names.push_back(name);
  }
  return names;
}

VkInstance makeInstance(bool validation, std::vector<const char*> extensions) {
  auto application = vulkanStruct<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.pApplicationName = "tessera";
  application.apiVersion = VK_API_VERSION_1_2;
  auto info = vulkanStruct<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  info.pApplicationInfo = &application;
  if (validation) {
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &kValidationLayer;
    extensions.push_back(kValidationExtension);
  }
  info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  VkInstance instance = VK_NULL_HANDLE;
  checkVulkan(vkCreateInstance(&info, nullptr, &instance), "vkCreateInstance");
  return instance;
}

// Loads the Vulkan functions from one instance that has all extensions we may use and lives as long as the process; the
// loader dispatches calls to the right instance. This also keeps drivers loaded, which leak when they are unloaded.
void loadCalls() {
  [[maybe_unused]] static const VkInstance first = [] {
    const VkInstance instance = makeInstance(false, surfaceExtensions());
    volkLoadInstance(instance);
    return instance;
  }();
}

uint64_t largestHeap(const VkPhysicalDeviceMemoryProperties& memory) {
  uint64_t bytes = 0;
  for (uint32_t i = 0; i < memory.memoryHeapCount; ++i) {
    const VkMemoryHeap& heap = memory.memoryHeaps[i];
    if (heap.flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) bytes = std::max<uint64_t>(bytes, heap.size);
  }
  return bytes;
}

// Mesa's driver for the CPU allocates and frees memory for each workgroup. If glibc returns it to the kernel each time,
// allocating it again takes a third of the training time.
void keepFreedMemory() {
#ifdef __GLIBC__
  constexpr int kMaxKept = 64 << 20;  // bytes; the largest possible heap of a thread
  mallopt(M_TRIM_THRESHOLD, kMaxKept);
#endif
}

}  // namespace

std::shared_ptr<GpuContext> GpuContext::open(const GpuOptions& options) {
  std::shared_ptr<GpuContext> context(new GpuContext);
  context->createInstance(options.validation || environment("TESSERA_VULKAN_VALIDATION") == "1");
  context->choosePhysicalDevice(options.device.empty() ? environment("TESSERA_GPU") : options.device);
  context->chooseQueueFamily();
  context->chooseFeatures(options.allowed);
  context->chooseGraphicsFeatures(options.allowedGraphics);
  context->createDevice(options.presents);
  context->heap_ = std::make_unique<GpuHeap>(*context);
  VkPhysicalDeviceProperties properties = {};
  vkGetPhysicalDeviceProperties(context->physicalDevice_, &properties);
  context->pipelines_ = std::make_unique<PipelineCache>(context->device_, properties);
  return context;
}

std::vector<GpuDescription> GpuContext::devices() {
  GpuContext context;
  context.createInstance(false);
  std::vector<GpuDescription> all;
  for (const PhysicalDevice& device : physicalDevices(context.instance_)) {
    GpuDescription description;
    description.name = device.properties.deviceName;
    description.driver = device.driver;
    description.isCpu = device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
    description.isDiscrete = device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
    description.missing = device.missing;
    try {
      if (description.missing.empty()) description.features = presentFeatures(device.handle);
    } catch (const Error& error) {  // affects this driver only
      description.missing = error.reason();
    }
    VkPhysicalDeviceMemoryProperties memory = {};
    vkGetPhysicalDeviceMemoryProperties(device.handle, &memory);
    description.memoryBytes = largestHeap(memory);
    all.push_back(std::move(description));
  }
  if (all.empty()) checkVulkan(VK_ERROR_INCOMPATIBLE_DRIVER, "vkEnumeratePhysicalDevices");
  return all;
}

GpuContext::~GpuContext() {
  if (device_) {
    vkDeviceWaitIdle(device_);
    pipelines_.reset();
    heap_.reset();
    vkDestroyDevice(device_, nullptr);
  }
  if (messenger_) destroyValidationMessenger(instance_, messenger_);
  if (instance_) vkDestroyInstance(instance_, nullptr);
}

// All instances have the same extensions: layers that sort devices, such as Mesa's, ask the screen only with these, and
// an index must mean the same device everywhere.
void GpuContext::createInstance(bool validation) {
  openLoader();
  validation = validation && validationInstalled();
  loadCalls();
  instance_ = makeInstance(validation, surfaceExtensions());
  if (validation) messenger_ = createValidationMessenger(instance_);
}

void GpuContext::choosePhysicalDevice(const std::string& requested) {
  const std::vector<PhysicalDevice> devices = physicalDevices(instance_);
  if (devices.empty()) checkVulkan(VK_ERROR_INCOMPATIBLE_DRIVER, "vkEnumeratePhysicalDevices");

  const PhysicalDevice& chosen = tessera::choosePhysicalDevice(devices, requested);
  requireFeatures(chosen);
  physicalDevice_ = chosen.handle;
  limits_ = chosen.properties.limits;
  isCpu_ = chosen.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  if (isCpu_) keepFreedMemory();
  isDiscrete_ = chosen.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
  name_ = fmt::format("{} ({})", chosen.properties.deviceName, chosen.driver);
  target_ = fmt::format("vulkan/{}/{}", chosen.properties.deviceName, chosen.driver);
  vkGetPhysicalDeviceMemoryProperties(physicalDevice_, &memory_);
  auto allocations =
      vulkanStruct<VkPhysicalDeviceMaintenance3Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES);
  auto properties = vulkanStruct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  properties.pNext = &allocations;
  vkGetPhysicalDeviceProperties2(physicalDevice_, &properties);
  largestAllocation_ = allocations.maxMemoryAllocationSize;
}

void GpuContext::chooseQueueFamily() {
  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(physicalDevice_, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(physicalDevice_, &count, families.data());
  for (VkQueueFlags flags : {VK_QUEUE_COMPUTE_BIT | VK_QUEUE_GRAPHICS_BIT, 0 | VK_QUEUE_COMPUTE_BIT}) {
    for (uint32_t i = 0; i < count; ++i) {
      if ((families[i].queueFlags & flags) != flags) continue;
      queueFamily_ = i;
      timestampBits_ = families[i].timestampValidBits;
      graphics_.queue = (families[i].queueFlags & VK_QUEUE_GRAPHICS_BIT) != 0;
      return;
    }
  }
  throw Error(name_, "", "it has no compute queue", "choose another device (tessera info devices)");
}

void GpuContext::chooseFeatures(const GpuFeatures& allowed) {
  const GpuFeatures has = presentFeatures(physicalDevice_);
  const std::string without = environment("TESSERA_GPU_WITHOUT");
  for (const auto& [name, feature] : kGpuFeatureNames) {
    features_.*feature = has.*feature && allowed.*feature && without.find(name) == std::string::npos;
  }
  features_.matrices = features_.matrices && features_.float16;
  if (features_.matrices) matrices_ = presentMatrices(physicalDevice_);
  for (const auto& [name, feature] : kGpuFeatureNames) {
    if (features_.*feature) target_ += fmt::format("+{}", name);
  }
}

void GpuContext::chooseGraphicsFeatures(const GpuGraphicsFeatures& allowed) {
  VkPhysicalDeviceFeatures present = {};
  vkGetPhysicalDeviceFeatures(physicalDevice_, &present);
  graphics_.queue = graphics_.queue && allowed.queue;
  graphics_.fragmentStores = graphics_.queue && allowed.fragmentStores && present.fragmentStoresAndAtomics;
  graphics_.independentBlend = graphics_.queue && allowed.independentBlend && present.independentBlend;
}

void GpuContext::requireGraphics() const {
  if (graphics_.queue) return;
  throw Error(name_, "", "it computes, but does not rasterise", "choose another device (tessera info devices)");
}

void GpuContext::createDevice(bool presents) {
  const float priority = 1;
  auto queue = vulkanStruct<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue.queueFamilyIndex = queueFamily_;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;

  auto atomics = vulkanStruct<VkPhysicalDeviceShaderAtomicFloatFeaturesEXT>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_FEATURES_EXT);
  atomics.shaderBufferFloat32AtomicAdd = VK_TRUE;
  auto subgroupSize = vulkanStruct<VkPhysicalDeviceSubgroupSizeControlFeaturesEXT>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES_EXT);
  subgroupSize.subgroupSizeControl = subgroupSize.computeFullSubgroups = VK_TRUE;
  auto nvMatrices = vulkanStruct<VkPhysicalDeviceCooperativeMatrixFeaturesNV>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_NV);
  nvMatrices.cooperativeMatrix = VK_TRUE;
#ifdef TESSERA_KHR_MATRICES
  auto khrMatrices = vulkanStruct<VkPhysicalDeviceCooperativeMatrixFeaturesKHR>(
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_KHR);
  khrMatrices.cooperativeMatrix = VK_TRUE;
#endif
  auto vulkan12 = vulkanStruct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
  vulkan12.vulkanMemoryModel = features_.matrices;  // required by kernels with cooperative matrices
  vulkan12.bufferDeviceAddress = VK_TRUE;
  vulkan12.timelineSemaphore = VK_TRUE;
  vulkan12.shaderFloat16 = features_.float16;
  auto vulkan11 = vulkanStruct<VkPhysicalDeviceVulkan11Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES);
  vulkan11.storageBuffer16BitAccess = features_.float16;
  auto features = vulkanStruct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  features.features.shaderFloat64 = features_.float64;
  features.features.fragmentStoresAndAtomics = graphics_.fragmentStores;
  features.features.independentBlend = graphics_.independentBlend;
  features.pNext = &vulkan11;
  vulkan11.pNext = &vulkan12;

  auto info = vulkanStruct<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  info.pNext = &features;
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue;
  std::vector<const char*> extensions;
  const auto add = [&](auto& feature, const char* extension) {
    feature.pNext = vulkan12.pNext;
    vulkan12.pNext = &feature;
    extensions.push_back(extension);
  };
  if (features_.floatAtomics) add(atomics, VK_EXT_SHADER_ATOMIC_FLOAT_EXTENSION_NAME);
  if (features_.matrices) add(subgroupSize, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME);
  if (matrices_.kind == GpuMatrices::Kind::nv) add(nvMatrices, VK_NV_COOPERATIVE_MATRIX_EXTENSION_NAME);
#ifdef TESSERA_KHR_MATRICES
  if (matrices_.kind == GpuMatrices::Kind::khr) add(khrMatrices, VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME);
#endif
  if (presents) {
    if (!hasDeviceExtension(physicalDevice_, VK_KHR_SWAPCHAIN_EXTENSION_NAME)) {
      throw Error(name_, "", "it cannot present images in windows", "choose another device (tessera info devices)");
    }
    extensions.push_back(VK_KHR_SWAPCHAIN_EXTENSION_NAME);
  }
  info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  checkVulkan(vkCreateDevice(physicalDevice_, &info, nullptr, &device_), "vkCreateDevice");
  vkGetDeviceQueue(device_, queueFamily_, 0, &queue_);
}

uint64_t GpuContext::memoryBytes() const {
  return largestHeap(memory_);
}

uint32_t GpuContext::memoryType(uint32_t typeBits, VkMemoryPropertyFlags required,
                                VkMemoryPropertyFlags preferred) const {
  for (VkMemoryPropertyFlags flags : {required | preferred, required}) {
    if (const std::optional<uint32_t> type = findMemoryType(typeBits, flags)) return *type;
  }
  throw Error(name_, "", "it has no memory type with the required properties", "update the graphics driver");
}

std::optional<uint32_t> GpuContext::findMemoryType(uint32_t typeBits, VkMemoryPropertyFlags required) const {
  for (uint32_t i = 0; i < memory_.memoryTypeCount; ++i) {
    const bool allowed = (typeBits >> i & 1) != 0;
    if (allowed && (memory_.memoryTypes[i].propertyFlags & required) == required) return i;
  }
  return std::nullopt;
}

uint32_t GpuContext::typesOfSameHeap(uint32_t type) const {
  uint32_t types = 0;
  for (uint32_t i = 0; i < memory_.memoryTypeCount; ++i) {
    if (memory_.memoryTypes[i].heapIndex == memory_.memoryTypes[type].heapIndex) types |= 1u << i;
  }
  return types;
}

int GpuContext::validationMessages() {
  return validationMessageCount();
}

}  // namespace tessera
