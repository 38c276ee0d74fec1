// A vertex and a fragment shader that draw triangles into a window's frame, blended over the previous contents
// (premultiplied colours). Like kernels, they take one push constant: the address of their arguments.
#pragma once

#include <volk.h>

#include <cstdint>
#include <memory>
#include <span>

#include "gpu/context.h"

namespace tessera {

class GpuScreenPipeline {
 public:
  // Throws Error if the driver rejects the shaders. `renderPass` must be compatible with the passes in which it
  // draws.
  GpuScreenPipeline(std::shared_ptr<const GpuContext> context, VkRenderPass renderPass,
                    std::span<const uint32_t> vertexSpirv, std::span<const uint32_t> fragmentSpirv);
  ~GpuScreenPipeline();
  GpuScreenPipeline(const GpuScreenPipeline&) = delete;
  GpuScreenPipeline& operator=(const GpuScreenPipeline&) = delete;

  VkPipeline pipeline() const { return pipeline_; }
  VkPipelineLayout layout() const { return layout_; }

  static constexpr VkShaderStageFlags kStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

 private:
  std::shared_ptr<const GpuContext> context_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
};

}  // namespace tessera
