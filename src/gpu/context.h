// The one door to Vulkan: instance, physical device, logical device and one queue, shared by compute and render.
// Needs Vulkan 1.2 with buffer device addresses; everything beyond is a feature that has a fallback.
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

// What kernels may use where the device has it. As part of GpuOptions: what they may use at all, so that tests force
// the fallbacks.
struct GpuFeatures {
  bool floatAtomics =
      true;               // 32-bit float atomic add on buffers (VK_EXT_shader_atomic_float); else a compare-swap loop
  bool float64 = true;    // double arithmetic; else fp32
  bool float16 = true;    // fp16 arithmetic and 16-bit storage; else fp32
  bool subgroups = true;  // subgroup arithmetic in compute; else shared memory
  bool matrices = true;   // GpuMatrices; needs float16
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

// What rasterisation (gpu/render_pass.h) may use where the device has it. Bits of kernels do not depend on it. As part
// of GpuOptions: what it may use at all, so that tests force the refusals.
struct GpuGraphicsFeatures {
  bool queue = true;             // the queue draws; else there is no rasterisation
  bool fragmentStores = true;    // fragment shaders write to buffers
  bool independentBlend = true;  // colour attachments of one pipeline blend in different ways
};

// How a device multiplies matrices by a subgroup together: fp16, rows × depth times depth × columns, summed in float.
struct GpuMatrices {
  enum class Kind { none, nv, khr };  // VK_NV_cooperative_matrix; VK_KHR_cooperative_matrix, of builds that know it
  Kind kind = Kind::none;
  uint32_t rows = 16, columns = 16, depth = 16;
  uint32_t subgroupSize = 32;                // that its kernels ask for
  static constexpr uint32_t kSubgroups = 4;  // of a workgroup of theirs
};

struct GpuOptions {
  // A part of the device's name, any case, or its index. Empty: the environment's TESSERA_GPU, else the best there is
  // (discrete, integrated, virtual, processor).
  std::string device;
  // Masked further by the environment's TESSERA_GPU_WITHOUT, a list of kGpuFeatureNames.
  GpuFeatures allowed;
  GpuGraphicsFeatures allowedGraphics;
  // Validation layers, if installed. The environment's TESSERA_VULKAN_VALIDATION=1 turns them on too.
  bool validation = false;
  // For pictures in windows (gpu/presenter.h).
  bool presents = false;
};

// A device of this machine, used or not.
struct GpuDescription {
  std::string name, driver;
  bool isProcessor = false;  // Mesa's lavapipe and the like
  bool isDiscrete = false;   // a card of its own
  uint64_t memoryBytes = 0;  // its own, or what it shares with the processor
  std::string missing;       // why it cannot be used; empty where it can
  GpuFeatures features;
};

class GpuContext {
 public:
  // In the order of their indices. Throws Error when there is no loader or no driver.
  static std::vector<GpuDescription> devices();
  // Throws Error when there is no driver, no such device, or the device lacks what we need.
  static std::shared_ptr<GpuContext> open(const GpuOptions& options = {});
  ~GpuContext();
  GpuContext(const GpuContext&) = delete;
  GpuContext& operator=(const GpuContext&) = delete;

  const std::string& name() const { return name_; }      // "NVIDIA GeForce RTX 3060 (driver 535.183)"
  const std::string& target() const { return target_; }  // what bits depend on: driver, device, features in use
  bool isProcessor() const { return isProcessor_; }      // Mesa's lavapipe and the like
  bool isDiscrete() const { return isDiscrete_; }        // a card of its own
  uint64_t memoryBytes() const;  // its largest heap: its own, or what it shares with the processor
  const GpuFeatures& features() const { return features_; }
  const GpuGraphicsFeatures& graphics() const { return graphics_; }
  // Throws Error where the device does not rasterise.
  void requireGraphics() const;
  const GpuMatrices& matrices() const { return matrices_; }  // with features().matrices
  const VkPhysicalDeviceLimits& limits() const { return limits_; }

  VkInstance instance() const { return instance_; }
  VkPhysicalDevice physicalDevice() const { return physicalDevice_; }
  VkDevice device() const { return device_; }
  VkQueue queue() const { return queue_; }  // compute and transfer, and graphics where the device draws at all
  uint32_t queueFamily() const { return queueFamily_; }
  void waitIdle() const { vkDeviceWaitIdle(device_); }       // for destructors: whatever went wrong, it is over
  uint32_t timestampBits() const { return timestampBits_; }  // of the queue's clock; 0: it has none

  GpuHeap& heap() const { return *heap_; }
  // Another number at each call. Drivers reuse the handles of objects that are gone; these tell such objects apart.
  uint64_t nextSerial() const { return ++serial_; }
  const PipelineCache& pipelines() const { return *pipelines_; }

  // The first memory type among `typeBits` that has all `wanted` properties, those with `preferred` first.
  uint32_t memoryType(uint32_t typeBits, VkMemoryPropertyFlags wanted, VkMemoryPropertyFlags preferred) const;
  std::optional<uint32_t> findMemoryType(uint32_t typeBits, VkMemoryPropertyFlags wanted) const;
  uint32_t typesOfSameHeap(uint32_t type) const;                     // as bits, itself among them
  uint64_t largestAllocation() const { return largestAllocation_; }  // bytes at once that the driver promises

  // Mistakes that the validation layers reported so far in this process, warnings too.
  static int validationMessages();
  bool validates() const { return messenger_ != VK_NULL_HANDLE; }

 private:
  GpuContext() = default;
  void createInstance(bool validation, bool presents);
  void choosePhysicalDevice(const std::string& wanted);
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
  bool isProcessor_ = false, isDiscrete_ = false;
  GpuFeatures features_;
  GpuGraphicsFeatures graphics_;
  mutable std::atomic<uint64_t> serial_ = 0;
  GpuMatrices matrices_;
  std::string name_, target_;
  std::unique_ptr<GpuHeap> heap_;
  std::unique_ptr<PipelineCache> pipelines_;
};

}  // namespace tessera
