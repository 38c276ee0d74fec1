#include "gpu/kernel.h"

#include <fmt/format.h>

#include <vector>

#include "gpu/call.h"
#include "gpu/pipeline_cache.h"

namespace tessera {

GpuKernel::GpuKernel(std::shared_ptr<const GpuContext> context, std::span<const uint32_t> spirv,
                     std::span<const uint32_t> constants, uint32_t subgroupSize)
    : context_(std::move(context)) {
  const VkDevice device = context_->device();

  VkPushConstantRange range = {VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(VkDeviceAddress)};
  auto layoutInfo = vulkanStruct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &range;
  checkVulkan(vkCreatePipelineLayout(device, &layoutInfo, nullptr, &layout_), "vkCreatePipelineLayout");

  std::vector<VkSpecializationMapEntry> entries;
  for (uint32_t i = 0; i < constants.size(); ++i) entries.push_back({i, i * 4, 4});
  VkSpecializationInfo specialization = {};
  specialization.mapEntryCount = static_cast<uint32_t>(entries.size());
  specialization.pMapEntries = entries.data();
  specialization.dataSize = constants.size_bytes();
  specialization.pData = constants.data();

  auto moduleInfo = vulkanStruct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  moduleInfo.codeSize = spirv.size_bytes();
  moduleInfo.pCode = spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  VkResult result = vkCreateShaderModule(device, &moduleInfo, nullptr, &module);
  if (result == VK_SUCCESS) {
    auto info = vulkanStruct<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.module = module;
    info.stage.pName = "main";
    info.stage.pSpecializationInfo = constants.empty() ? nullptr : &specialization;
    auto size = vulkanStruct<VkPipelineShaderStageRequiredSubgroupSizeCreateInfoEXT>(
        VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO_EXT);
    size.requiredSubgroupSize = subgroupSize;
    if (subgroupSize > 0) {
      info.stage.pNext = &size;
      info.stage.flags = VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT_EXT;
    }
    info.layout = layout_;
    result = vkCreateComputePipelines(device, context_->pipelines().handle(), 1, &info, nullptr, &pipeline_);
    vkDestroyShaderModule(device, module, nullptr);
  }
  if (result != VK_SUCCESS) vkDestroyPipelineLayout(device, layout_, nullptr);
  if (result < 0 && result != VK_ERROR_OUT_OF_DEVICE_MEMORY && result != VK_ERROR_OUT_OF_HOST_MEMORY &&
      result != VK_ERROR_DEVICE_LOST) {
    throw KernelRefused(context_->name(), "vkCreateComputePipelines",
                        fmt::format("VkResult {}", static_cast<int>(result)), "update the graphics driver");
  }
  checkVulkan(result, "vkCreateComputePipelines");
}

GpuKernel::~GpuKernel() {
  vkDestroyPipeline(context_->device(), pipeline_, nullptr);
  vkDestroyPipelineLayout(context_->device(), layout_, nullptr);
}

}  // namespace tessera
