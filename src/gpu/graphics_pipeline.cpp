#include "gpu/graphics_pipeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"
#include "gpu/kernel.h"
#include "gpu/pipeline_cache.h"

namespace tessera {

namespace {

constexpr const char* kOtherDevice = "choose another device (tessera info devices)";

// A shader module, which is needed only while a pipeline is created.
class ShaderModule {
 public:
  ShaderModule(VkDevice device, std::span<const uint32_t> spirv) : device_(device) {
    auto info = vulkanStruct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    info.codeSize = spirv.size_bytes();
    info.pCode = spirv.data();
    checkVulkan(vkCreateShaderModule(device, &info, nullptr, &module_), "vkCreateShaderModule");
  }
  ~ShaderModule() { vkDestroyShaderModule(device_, module_, nullptr); }
  ShaderModule(const ShaderModule&) = delete;
  ShaderModule& operator=(const ShaderModule&) = delete;
  VkShaderModule handle() const { return module_; }

 private:
  VkDevice device_;
  VkShaderModule module_ = VK_NULL_HANDLE;
};

class CompatiblePass {
 public:
  CompatiblePass(const GpuContext& context, const AttachmentFormats& formats)
      : device_(context.device()), pass_(GpuRenderPass::makeCompatible(context, formats)) {}
  ~CompatiblePass() { vkDestroyRenderPass(device_, pass_, nullptr); }
  CompatiblePass(const CompatiblePass&) = delete;
  CompatiblePass& operator=(const CompatiblePass&) = delete;
  VkRenderPass handle() const { return pass_; }

 private:
  VkDevice device_;
  VkRenderPass pass_;
};

VkPipelineColorBlendAttachmentState blendState(Blend blend) {
  VkPipelineColorBlendAttachmentState state = {};
  state.blendEnable = blend != Blend::none;
  state.srcColorBlendFactor = state.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  state.dstColorBlendFactor = state.dstAlphaBlendFactor =
      blend == Blend::add ? VK_BLEND_FACTOR_ONE : VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  state.colorWriteMask =
      VK_COLOR_COMPONENT_R_BIT | VK_COLOR_COMPONENT_G_BIT | VK_COLOR_COMPONENT_B_BIT | VK_COLOR_COMPONENT_A_BIT;
  return state;
}

// The fixed-function state. Its members point at each other, so it must not be moved.
struct FixedState {
  explicit FixedState(const GraphicsPipelineOptions& options) {
    assembly.topology = options.topology;
    viewport.viewportCount = viewport.scissorCount = 1;
    raster.lineWidth = 1;
    raster.cullMode = options.cull;
    raster.frontFace = options.frontFace;
    samples.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
    depth.depthTestEnable = options.depth.has_value() && options.depthTest;
    depth.depthWriteEnable = options.depth.has_value() && options.depthWrite;
    depth.depthCompareOp = options.depthCompare;
    for (const ColourOutput& colour : options.colours) blends.push_back(blendState(colour.blend));
    blend.attachmentCount = static_cast<uint32_t>(blends.size());
    blend.pAttachments = blends.data();
    dynamic.dynamicStateCount = static_cast<uint32_t>(dynamicStates.size());
    dynamic.pDynamicStates = dynamicStates.data();
  }
  FixedState(const FixedState&) = delete;
  FixedState& operator=(const FixedState&) = delete;

  VkPipelineVertexInputStateCreateInfo vertices =
      vulkanStruct<VkPipelineVertexInputStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO);
  VkPipelineInputAssemblyStateCreateInfo assembly =
      vulkanStruct<VkPipelineInputAssemblyStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO);
  VkPipelineViewportStateCreateInfo viewport =
      vulkanStruct<VkPipelineViewportStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO);
  VkPipelineRasterizationStateCreateInfo raster =
      vulkanStruct<VkPipelineRasterizationStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO);
  VkPipelineMultisampleStateCreateInfo samples =
      vulkanStruct<VkPipelineMultisampleStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO);
  VkPipelineDepthStencilStateCreateInfo depth =
      vulkanStruct<VkPipelineDepthStencilStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO);
  VkPipelineColorBlendStateCreateInfo blend =
      vulkanStruct<VkPipelineColorBlendStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO);
  VkPipelineDynamicStateCreateInfo dynamic =
      vulkanStruct<VkPipelineDynamicStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO);
  std::vector<VkPipelineColorBlendAttachmentState> blends;
  static constexpr std::array dynamicStates = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
};

}  // namespace

GpuGraphicsPipeline::GpuGraphicsPipeline(std::shared_ptr<const GpuContext> context,
                                         std::span<const uint32_t> vertexSpirv, std::span<const uint32_t> fragmentSpirv,
                                         const GraphicsPipelineOptions& options)
    : GpuGraphicsPipeline(std::move(context)) {  // from here on the destructor cleans up
  requireSupport(options);
  for (const ColourOutput& colour : options.colours) formats_.colours.push_back(colour.format);
  formats_.depth = options.depth;
  const VkDevice device = context_->device();
  const VkPushConstantRange range = {kStages, 0, sizeof(VkDeviceAddress)};
  auto layout = vulkanStruct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &range;
  checkVulkan(vkCreatePipelineLayout(device, &layout, nullptr, &layout_), "vkCreatePipelineLayout");

  std::vector<VkSpecializationMapEntry> entries;
  for (uint32_t i = 0; i < options.constants.size(); ++i) entries.push_back({i, i * 4, 4});
  const VkSpecializationInfo specialization = {static_cast<uint32_t>(entries.size()), entries.data(),
                                               options.constants.size() * sizeof(uint32_t), options.constants.data()};
  const ShaderModule vertex(device, vertexSpirv), fragment(device, fragmentSpirv);
  VkPipelineShaderStageCreateInfo stages[2] = {};
  for (VkPipelineShaderStageCreateInfo& stage : stages) {
    stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    stage.pName = "main";
    stage.pSpecializationInfo = entries.empty() ? nullptr : &specialization;
  }
  stages[0].stage = VK_SHADER_STAGE_VERTEX_BIT;
  stages[0].module = vertex.handle();
  stages[1].stage = VK_SHADER_STAGE_FRAGMENT_BIT;
  stages[1].module = fragment.handle();

  const FixedState fixed(options);
  const CompatiblePass pass(*context_, formats_);
  auto info = vulkanStruct<VkGraphicsPipelineCreateInfo>(VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO);
  info.stageCount = 2;
  info.pStages = stages;
  info.pVertexInputState = &fixed.vertices;
  info.pInputAssemblyState = &fixed.assembly;
  info.pViewportState = &fixed.viewport;
  info.pRasterizationState = &fixed.raster;
  info.pMultisampleState = &fixed.samples;
  info.pDepthStencilState = &fixed.depth;
  info.pColorBlendState = &fixed.blend;
  info.pDynamicState = &fixed.dynamic;
  info.layout = layout_;
  info.renderPass = pass.handle();
  const VkResult result =
      vkCreateGraphicsPipelines(device, context_->pipelines().handle(), 1, &info, nullptr, &pipeline_);
  if (result < 0 && result != VK_ERROR_OUT_OF_DEVICE_MEMORY && result != VK_ERROR_OUT_OF_HOST_MEMORY &&
      result != VK_ERROR_DEVICE_LOST) {
    throw KernelRefused(context_->name(), "vkCreateGraphicsPipelines",
                        fmt::format("VkResult {}", static_cast<int>(result)), "update the graphics driver");
  }
  checkVulkan(result, "vkCreateGraphicsPipelines");
}

GpuGraphicsPipeline::~GpuGraphicsPipeline() {
  if (pipeline_) vkDestroyPipeline(context_->device(), pipeline_, nullptr);
  if (layout_) vkDestroyPipelineLayout(context_->device(), layout_, nullptr);
}

void GpuGraphicsPipeline::requireSupport(const GraphicsPipelineOptions& options) const {
  context_->requireGraphics();
  for (const ColourOutput& colour : options.colours) {
    CHECK(!isDepth(colour.format));
    if (colour.blend == Blend::none) continue;
    CHECK(!isInteger(colour.format));
    VkFormatProperties properties = {};
    vkGetPhysicalDeviceFormatProperties(context_->physicalDevice(), vulkanFormat(colour.format), &properties);
    if (!(properties.optimalTilingFeatures & VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT)) {
      throw Error(context_->name(), "",
                  fmt::format("it does not blend images of the format {}", formatName(colour.format)), kOtherDevice);
    }
  }
  const auto differs = [&](const ColourOutput& colour) { return colour.blend != options.colours[0].blend; };
  if (!context_->graphics().independentBlend && std::any_of(options.colours.begin(), options.colours.end(), differs)) {
    throw Error(context_->name(), "", "it does not blend several images in different ways at once", kOtherDevice);
  }
  if (options.fragmentStores && !context_->graphics().fragmentStores) {
    throw Error(context_->name(), "", "its fragment shaders do not write to buffers", kOtherDevice);
  }
}

DrawCount DrawCount::counted(const GpuBuffer& words, size_t offset) {
  CHECK(offset % 4 == 0u);
  CHECK(offset + sizeof(VkDrawIndirectCommand) <= words.bytes());
  DrawCount count;
  count.buffer = words.handle();
  count.offset = words.offset() + offset;
  return count;
}

}  // namespace tessera
