#include "compute/blend.h"

#include <algorithm>

#include "compute/vulkan/vulkan_device.h"
#include "shaders/blend_backward.h"
#include "shaders/blend_forward.h"
#include "shaders/compute/arguments_deferred.h"

namespace tessera {

namespace {

constexpr uint32_t kBlendRaysPerGroup = 64;  // local_size_x of the kernels

template <class Options>
arguments::BlendArguments blendArguments(const VulkanDevice& device, const Options& options) {
  arguments::BlendArguments arguments = {};
  arguments.rays = device.countArguments(options.rays);
  arguments.firstSegment = deviceAddress(options.firstSegment);
  arguments.composited = deviceAddress(options.composited);
  arguments.specular = deviceAddress(options.specular);
  arguments.opacities = deviceAddress(options.opacities);
  return arguments;
}

}  // namespace

template <>
void VulkanDevice::enqueue(const BlendForward& options) {
  arguments::BlendArguments arguments = blendArguments(*this, options);
  arguments.depths = deviceAddress(options.depths);
  arguments.colour = deviceAddress(options.colour);
  arguments.opacity = deviceAddress(options.opacity);
  arguments.depth = deviceAddress(options.depth);
  queue(kernel(kBlendForwardSpirv, {options.literal}), arguments, countGroups(options.rays, kBlendRaysPerGroup));
}

template <>
void VulkanDevice::enqueue(const BlendBackward& options) {
  arguments::BlendArguments arguments = blendArguments(*this, options);
  arguments.colour = deviceAddress(options.rayColourGradients);
  arguments.opacity = deviceAddress(options.rayOpacityGradients);
  arguments.transmittances = scratch(std::max<size_t>(options.opacityGradients.count, 1));
  arguments.compositedGradients = deviceAddress(options.compositedGradients);
  arguments.specularGradients = deviceAddress(options.specularGradients);
  arguments.opacityGradients = deviceAddress(options.opacityGradients);
  queue(kernel(kBlendBackwardSpirv, {options.literal}), arguments, countGroups(options.rays, kBlendRaysPerGroup));
}

}  // namespace tessera
