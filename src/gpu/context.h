// The Vulkan context: instance, physical device, logical device and one queue, shared by compute and rendering. It
// requires Vulkan 1.2 with buffer device addresses and timeline semaphores; every other feature has a fallback.
#pragma once

#include <volk.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tessera {

class GpuHeap;
class PipelineCache;

// The optional features that kernels use if the device supports them. In GpuOptions: the features that kernels are
// allowed to use, so that tests can force the fallbacks.
struct GpuFeatures {
  // 32-bit float atomic add on buffers (VK_EXT_shader_atomic_float); otherwise a compare-and-swap loop.
  bool floatAtomics = true;
  bool float64 = true;    // double arithmetic; otherwise fp32
  bool float16 = true;    // fp16 arithmetic and 16-bit storage; otherwise fp32
  bool subgroups = true;  // subgroup arithmetic in compute; otherwise shared memory
  bool matrices = true;   // see GpuMatrices; requires float16
};
struct GpuFeatureName {
  const char* name;
  bool GpuFeatures::*feature;
};
inline constexpr GpuFeatureName kGpuFeatureNames[] = {{"floatAtomics", &GpuFeatures::floatAtomics},
                                                      {"float64", &GpuFeatures::float64},
                                                      {"float16", &GpuFeatures::float16},
                                                      {"subgroups", &GpuFeatures::subgroups},
                                                      {"matrices", &GpuFeatures::matrices}};

// The optional features that rasterisation (gpu/render_pass.h) uses if the device supports them. The results of kernels
// do not depend on them. In GpuOptions: the features that rasterisation is allowed to use, so that tests can force the
// errors.
struct GpuGraphicsFeatures {
  bool queue = true;             // the queue supports graphics; otherwise there is no rasterisation
  bool fragmentStores = true;    // fragment shaders can write to buffers
  bool independentBlend = true;  // colour attachments of one pipeline can have different blend modes
};

// The cooperative matrices of a device: a subgroup multiplies fp16 matrices of rows × depth and depth × columns and
// sums the products in float.
struct GpuMatrices {
  enum class Kind { none, nv, khr };  // VK_NV_cooperative_matrix; VK_KHR_cooperative_matrix if the build supports it
  Kind kind = Kind::none;
  uint32_t rows = 16, columns = 16, depth = 16;
  uint32_t subgroupSize = 32;                   // required by the kernels that use them
  static constexpr uint32_t kSubgroups = 4;     // per workgroup of these kernels
  static constexpr uint32_t kMaxThreads = 256;  // per workgroup: they divide a block of samples evenly
};

struct GpuOptions {
  // A part of the device's name (case-insensitive) or its index. If empty, the environment variable TESSERA_GPU is
  // used, otherwise the best usable device (in the order discrete GPU, integrated GPU, virtual GPU, CPU).
  std::string device;
  // The environment variable TESSERA_GPU_WITHOUT, a list of kGpuFeatureNames, disables further features.
  GpuFeatures allowed;
  GpuGraphicsFeatures allowedGraphics;
  // Enables the validation layers if they are installed. The environment variable TESSERA_VULKAN_VALIDATION=1 enables
  // them too.
  bool validation = false;
  // Enables presentation to windows (gpu/presenter.h).
  bool presents = false;
};

// A Vulkan device of this machine.
struct GpuDescription {
  std::string name, driver;
  bool isCpu = false;        // a software driver such as Mesa's lavapipe
  bool isDiscrete = false;   // a discrete GPU
  uint64_t memoryBytes = 0;  // its dedicated memory, or the memory that it shares with the CPU
  std::string missing;       // the missing requirement, for example "no Vulkan 1.2"; empty if the device can be used
  GpuFeatures features;
};

class GpuContext {
 public:
  // Returns all devices in the order of their indices. Throws Error if there is no Vulkan loader or no driver.
  static std::vector<GpuDescription> devices();
  // Throws Error if there is no loader, no driver or no such device, or if the device lacks a required feature.
  static std::shared_ptr<GpuContext> open(const GpuOptions& options = {});
  ~GpuContext();
  GpuContext(const GpuContext&) = delete;
  GpuContext& operator=(const GpuContext&) = delete;

  const std::string& name() const { return name_; }      // "NVIDIA GeForce RTX 3060 (driver 535.183)"
  const std::string& target() const { return target_; }  // device, driver and features: all that results depend on
  bool isCpu() const { return isCpu_; }                  // a software driver such as Mesa's lavapipe
  bool isDiscrete() const { return isDiscrete_; }        // a discrete GPU
  uint64_t memoryBytes() const;                          // of its largest device-local heap
  const GpuFeatures& features() const { return features_; }
  const GpuGraphicsFeatures& graphics() const { return graphics_; }
  // Throws Error if the device does not rasterise.
  void requireGraphics() const;
  const GpuMatrices& matrices() const { return matrices_; }  // valid if features().matrices
  const VkPhysicalDeviceLimits& limits() const { return limits_; }

  VkInstance instance() const { return instance_; }
  VkPhysicalDevice physicalDevice() const { return physicalDevice_; }
  VkDevice device() const { return device_; }
  VkQueue queue() const { return queue_; }  // compute, transfer and, if graphics().queue, graphics
  uint32_t queueFamily() const { return queueFamily_; }
  void waitIdle() const { vkDeviceWaitIdle(device_); }       // for destructors: ignores errors
  uint32_t timestampBits() const { return timestampBits_; }  // valid bits of the queue's timestamps; 0: not supported

  GpuHeap& heap() const { return *heap_; }
  // Returns a new number at each call. Drivers reuse the handles of destroyed objects; serial numbers tell them apart.
  uint64_t nextSerial() const { return ++serial_; }
  const PipelineCache& pipelines() const { return *pipelines_; }

  // Returns the first memory type among `typeBits` that has all `required` properties; types that also have the
  // `preferred` ones come first. Throws Error if there is none.
  uint32_t memoryType(uint32_t typeBits, VkMemoryPropertyFlags required, VkMemoryPropertyFlags preferred) const;
  std::optional<uint32_t> findMemoryType(uint32_t typeBits, VkMemoryPropertyFlags required) const;
  uint32_t typesOfSameHeap(uint32_t type) const;                     // as bits, including `type`
  uint64_t largestAllocation() const { return largestAllocation_; }  // maxMemoryAllocationSize, bytes

  // Returns the number of errors and warnings that the validation layers have reported so far in this process.
  static int validationMessages();
  bool validates() const { return messenger_ != VK_NULL_HANDLE; }

 private:
  GpuContext() = default;
  void createInstance(bool validation);
  void choosePhysicalDevice(const std::string& requested);
  void chooseQueueFamily();
  void chooseFeatures(const GpuFeatures& allowed);
  void chooseGraphicsFeatures(const GpuGraphicsFeatures& allowed);
  void createDevice(bool presents);

  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  VkPhysicalDevice physicalDevice_ = VK_NULL_HANDLE;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  uint32_t queueFamily_ = 0, timestampBits_ = 0;
  VkPhysicalDeviceLimits limits_ = {};
  VkPhysicalDeviceMemoryProperties memory_ = {};
  uint64_t largestAllocation_ = 0;
  bool isCpu_ = false, isDiscrete_ = false;
  GpuFeatures features_;
  GpuGraphicsFeatures graphics_;
  mutable std::atomic<uint64_t> serial_ = 0;
  GpuMatrices matrices_;
  std::string name_, target_;
  std::unique_ptr<GpuHeap> heap_;
  std::unique_ptr<PipelineCache> pipelines_;
};

}  // namespace tessera
