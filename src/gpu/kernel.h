// A compute pipeline. The interface of every kernel is one push constant: the address of its arguments.
#pragma once

#include <volk.h>

#include <cstdint>
#include <memory>
#include <span>

#include "base/error.h"
#include "gpu/context.h"

namespace tessera {

// Thrown if the driver does not compile a shader, but not if memory is insufficient or the device is lost.
class KernelRefused : public Error {
 public:
  using Error::Error;
};

class GpuKernel {
 public:
  // `constants` are the values of the shader's specialization constants 0, 1, 2, ... If `subgroupSize` is not 0, all
  // subgroups are full and have that many lanes (GpuMatrices::subgroupSize). Throws KernelRefused if the driver does
  // not compile the shader, and Error for other failures.
  GpuKernel(std::shared_ptr<const GpuContext> context, std::span<const uint32_t> spirv,
            std::span<const uint32_t> constants = {}, uint32_t subgroupSize = 0);
  ~GpuKernel();
  GpuKernel(const GpuKernel&) = delete;
  GpuKernel& operator=(const GpuKernel&) = delete;

  VkPipeline pipeline() const { return pipeline_; }
  VkPipelineLayout layout() const { return layout_; }

 private:
  std::shared_ptr<const GpuContext> context_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
};

}  // namespace tessera
