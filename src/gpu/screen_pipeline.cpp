#include "gpu/screen_pipeline.h"

#include "gpu/call.h"
#include "gpu/pipeline_cache.h"

namespace tessera {

namespace {

VkResult makeStage(VkDevice device, VkShaderStageFlagBits stage, std::span<const uint32_t> spirv,
                   VkPipelineShaderStageCreateInfo& info) {
  auto module = vulkanStruct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  module.codeSize = spirv.size_bytes();
  module.pCode = spirv.data();
  info = vulkanStruct<VkPipelineShaderStageCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO);
  info.stage = stage;
  info.pName = "main";
  return vkCreateShaderModule(device, &module, nullptr, &info.module);
}

}  // namespace

GpuScreenPipeline::GpuScreenPipeline(std::shared_ptr<const GpuContext> context, VkRenderPass renderPass,
                                     std::span<const uint32_t> vertexSpirv, std::span<const uint32_t> fragmentSpirv)
    : context_(std::move(context)) {
  const VkDevice device = context_->device();
  const VkPushConstantRange range = {kStages, 0, sizeof(VkDeviceAddress)};
  auto layout = vulkanStruct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &range;
  checkVulkan(vkCreatePipelineLayout(device, &layout, nullptr, &layout_), "vkCreatePipelineLayout");

  // Vertices and all data that fragment shaders read are fetched by address.
  const auto vertices =
      vulkanStruct<VkPipelineVertexInputStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO);
  auto triangles =
      vulkanStruct<VkPipelineInputAssemblyStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO);
  triangles.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  auto viewport =
      vulkanStruct<VkPipelineViewportStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO);
  viewport.viewportCount = viewport.scissorCount = 1;
  auto raster =
      vulkanStruct<VkPipelineRasterizationStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO);
  raster.lineWidth = 1;
  auto samples =
      vulkanStruct<VkPipelineMultisampleStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO);
  samples.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
  VkPipelineColorBlendAttachmentState over = {};
  over.blendEnable = VK_TRUE;
  over.srcColorBlendFactor = over.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  over.dstColorBlendFactor = over.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  over.colorWriteMask =
      VK_COLOR_COMPONENT_R_BIT | VK_COLOR_COMPONENT_G_BIT | VK_COLOR_COMPONENT_B_BIT | VK_COLOR_COMPONENT_A_BIT;
  auto blend =
      vulkanStruct<VkPipelineColorBlendStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO);
  blend.attachmentCount = 1;
  blend.pAttachments = &over;
  const VkDynamicState states[] = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
  auto dynamic = vulkanStruct<VkPipelineDynamicStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO);
  dynamic.dynamicStateCount = 2;
  dynamic.pDynamicStates = states;

  VkPipelineShaderStageCreateInfo stages[2] = {};
  VkResult result = makeStage(device, VK_SHADER_STAGE_VERTEX_BIT, vertexSpirv, stages[0]);
  if (result == VK_SUCCESS) result = makeStage(device, VK_SHADER_STAGE_FRAGMENT_BIT, fragmentSpirv, stages[1]);
  if (result == VK_SUCCESS) {
    auto info = vulkanStruct<VkGraphicsPipelineCreateInfo>(VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO);
    info.stageCount = 2;
    info.pStages = stages;
    info.pVertexInputState = &vertices;
    info.pInputAssemblyState = &triangles;
    info.pViewportState = &viewport;
    info.pRasterizationState = &raster;
    info.pMultisampleState = &samples;
    info.pColorBlendState = &blend;
    info.pDynamicState = &dynamic;
    info.layout = layout_;
    info.renderPass = renderPass;
    result = vkCreateGraphicsPipelines(device, context_->pipelines().handle(), 1, &info, nullptr, &pipeline_);
  }
  for (const VkPipelineShaderStageCreateInfo& stage : stages) vkDestroyShaderModule(device, stage.module, nullptr);
  if (result != VK_SUCCESS) vkDestroyPipelineLayout(device, layout_, nullptr);
  checkVulkan(result, "vkCreateGraphicsPipelines");
}

GpuScreenPipeline::~GpuScreenPipeline() {
  vkDestroyPipeline(context_->device(), pipeline_, nullptr);
  vkDestroyPipelineLayout(context_->device(), layout_, nullptr);
}

}  // namespace tessera
