// A vertex and a fragment shader that draw triangles off the screen, in render passes of certain formats
// (gpu/render_pass.h). Nothing is bound: like kernels they take one push constant, the address of their arguments, and
// fetch vertices, indices and all else by address.
//
// A fragment shader that is to know its triangle gets gl_VertexIndex / 3 as a flat output of the vertex shader:
// gl_PrimitiveID would ask for geometry shaders, which not all devices have.
#pragma once

#include <volk.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "gpu/buffer.h"
#include "gpu/context.h"
#include "gpu/render_pass.h"

namespace tessera {

enum class Blend {
  none,               // what is drawn replaces what was there
  premultipliedOver,  // source + (1 - source alpha) * destination
  add,                // source + destination
};

struct ColourOutput {
  ImageFormat format = ImageFormat::rgba8;
  Blend blend = Blend::none;  // none for integers
};

struct GraphicsPipelineOptions {
  std::vector<ColourOutput> colours;              // by location of the fragment shader's outputs
  std::optional<ImageFormat> depth;               // without one there is no depth test
  bool depthTest = true, depthWrite = true;       // where there is depth; nothing is written without the test
  VkCompareOp depthCompare = VK_COMPARE_OP_LESS;  // nearer is less, as passes that clear to 1 want it
  VkCullModeFlags cull = VK_CULL_MODE_NONE;
  VkFrontFace frontFace = VK_FRONT_FACE_COUNTER_CLOCKWISE;             // as seen in the picture, y downwards
  VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;  // or another kind of triangles
  std::vector<uint32_t> constants;  // specialization constants 0, 1, 2, ... of both shaders
  bool fragmentStores = false;      // the fragment shader writes to buffers
};

class GpuGraphicsPipeline {
 public:
  // Throws Error where the device does not rasterise, cannot blend so, lets no fragment shader write to buffers, or
  // refuses the shaders (KernelRefused).
  GpuGraphicsPipeline(std::shared_ptr<const GpuContext> context, std::span<const uint32_t> vertexSpirv,
                      std::span<const uint32_t> fragmentSpirv, const GraphicsPipelineOptions& options);
  ~GpuGraphicsPipeline();
  GpuGraphicsPipeline(const GpuGraphicsPipeline&) = delete;
  GpuGraphicsPipeline& operator=(const GpuGraphicsPipeline&) = delete;

  const AttachmentFormats& formats() const { return formats_; }
  VkPipeline pipeline() const { return pipeline_; }
  VkPipelineLayout layout() const { return layout_; }

  static constexpr VkShaderStageFlags kStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

 private:
  explicit GpuGraphicsPipeline(std::shared_ptr<const GpuContext> context) : context_(std::move(context)) {}
  void requireSupport(const GraphicsPipelineOptions& options) const;

  std::shared_ptr<const GpuContext> context_;
  AttachmentFormats formats_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
};

// How much is drawn: numbers, or what stands in the device's memory when the draw's turn has come.
struct DrawCount {
  uint32_t vertices = 0, instances = 1;  // gl_VertexIndex and gl_InstanceIndex count from 0
  VkBuffer buffer = VK_NULL_HANDLE;      // where set: read at `offset` of it
  VkDeviceSize offset = 0;

  // Four words: vertices, instances, the first gl_VertexIndex, and 0. `offset` is a multiple of 4.
  static DrawCount counted(const GpuBuffer& words, size_t offset);
  bool operator==(const DrawCount&) const = default;
};

struct DrawCall {
  const GpuGraphicsPipeline* pipeline = nullptr;  // stays until the stream goes: what was recorded names it
  std::span<const std::byte> arguments;           // copied
  DrawCount count;
};

}  // namespace tessera
