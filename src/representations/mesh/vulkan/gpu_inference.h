// Infers the textures of contents on the GPU, compressed there (Gu et al. 2023, UE4-NeRF, section 3.3, "dynamic
// inference"). On the CPU, MapInference does (representations/mesh/content/infer_maps.h).
#pragma once

#include <cstdint>
#include <list>
#include <memory>

#include "gpu/stream.h"
#include "render/vulkan/kernel_variants.h"
#include "representations/mesh/content/mesh_content.h"
#include "representations/mesh/vulkan/gpu_mesh_content.h"

namespace tessera {

class GpuInference {
 public:
  explicit GpuInference(std::shared_ptr<GpuStream> stream);
  ~GpuInference();
  GpuInference(const GpuInference&) = delete;
  GpuInference& operator=(const GpuInference&) = delete;

  // Limits the GPU memory for encoders. Those that were used last stay there, and in main memory, for further contents.
  void setBudget(uint64_t bytes);
  uint64_t memoryBytes() const { return bytes_; }  // never more than the budget

  // Returns whether each encoder alone is within the budget. May be called by several threads at a time, but not during
  // setBudget().
  bool fits(const MeshContent& content) const;
  // Queues the inference of the textures of all parts that have an encoder. `onGpu` was made from `content`, which fits
  // and whose textures need not exist.
  void infer(const MeshContent& content, const GpuMeshContent& onGpu);

 private:
  struct Encoder {
    std::shared_ptr<const SharedEncoder> source;
    GpuBuffer memory;
    uint64_t table = 0, layers = 0, weights = 0;  // device addresses
    uint32_t layerCount = 0, maxWidth = 0;
  };
  const Encoder& ensure(const std::shared_ptr<const SharedEncoder>& source);
  void evict();  // the encoder that was not used for the longest time

  std::shared_ptr<GpuStream> stream_;
  KernelVariants kernels_;
  std::list<Encoder> encoders_;  // the most recently used first
  uint64_t budget_ = uint64_t{128} << 20, bytes_ = 0;
};

}  // namespace tessera
