// A vertex and a fragment shader that draw triangles off-screen, in render passes with given attachment formats
// (gpu/render_pass.h). There are no descriptors or vertex bindings: like kernels, the shaders take one push constant,
// the address of their arguments, and fetch vertices, indices and all other data by address.
//
// A fragment shader that needs the index of its triangle receives gl_VertexIndex / 3 as a flat output of the vertex
// shader: gl_PrimitiveID requires the geometry shader feature, which not all devices have.
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
  none,               // the source replaces the destination
  premultipliedOver,  // source + (1 - source alpha) * destination
  add,                // source + destination
};

struct ColourOutput {
  ImageFormat format = ImageFormat::rgba8;
  Blend blend = Blend::none;  // must be none for integer formats
};

struct GraphicsPipelineOptions {
  std::vector<ColourOutput> colours;              // by location of the fragment shader's outputs
  std::optional<ImageFormat> depth;               // if empty, there is no depth test
  bool depthTest = true, depthWrite = true;       // apply if `depth` is set; depth is not written without the test
  VkCompareOp depthCompare = VK_COMPARE_OP_LESS;  // less is nearer: for passes that clear depth to 1
  VkCullModeFlags cull = VK_CULL_MODE_NONE;
  VkFrontFace frontFace = VK_FRONT_FACE_COUNTER_CLOCKWISE;             // as seen in the image, y downwards
  VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;  // or another triangle topology
  std::vector<uint32_t> constants;  // specialization constants 0, 1, 2, ... of both shaders
  bool fragmentStores = false;      // the fragment shader writes to buffers
};

class GpuGraphicsPipeline {
 public:
  // Throws Error if the device does not rasterise, does not support the blend modes, or does not support writes from
  // fragment shaders although options.fragmentStores is set; throws KernelRefused if the driver rejects the shaders.
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

// The number of vertices and instances of a draw: given directly, or read from device memory when the draw is executed.
struct DrawCount {
  uint32_t vertices = 0, instances = 1;  // gl_VertexIndex and gl_InstanceIndex count from 0
  VkBuffer buffer = VK_NULL_HANDLE;      // if set, the counts are read from it at `offset`
  VkDeviceSize offset = 0;

  // Reads four words at `offset`, a multiple of 4: vertices, instances, the first gl_VertexIndex, and 0.
  static DrawCount counted(const GpuBuffer& words, size_t offset);
  bool operator==(const DrawCount&) const = default;
};

struct DrawCall {
  const GpuGraphicsPipeline* pipeline = nullptr;  // must outlive the stream, whose recorded commands refer to it
  std::span<const std::byte> arguments;           // copied
  DrawCount count;
};

}  // namespace tessera
