#include "compute/attention.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/attention_backward.h"
#include "shaders/attention_backward_float_atomics.h"
#include "shaders/attention_backward_subgroups.h"
#include "shaders/attention_backward_subgroups_float_atomics.h"
#include "shaders/attention_forward.h"
#include "shaders/compute/arguments_attention.h"
#include "shaders/shade_backward.h"
#include "shaders/shade_forward.h"

namespace tessera {

namespace {

std::vector<uint32_t> specialisationConstants(const AttentionShape& shape) {
  return {shape.levels, static_cast<uint32_t>(shape.weights), shape.varies};
}

template <class Options>
arguments::AttentionArguments attentionArguments(const VulkanDevice& device, const Options& options) {
  CHECK(options.fine.columns == AttentionShape::kFeatures * options.shape.levels);
  arguments::AttentionArguments arguments = {};
  arguments.samples = device.countArguments(options.samples);
  arguments.coarse = matrixArguments(options.coarse, options.samples.capacity);
  arguments.fine = matrixArguments(options.fine, options.samples.capacity);
  arguments.logits = deviceAddress(options.logits);
  return arguments;
}

template <class Options>
arguments::ShadeArguments shadeArguments(const VulkanDevice& device, const Options& options) {
  arguments::ShadeArguments arguments = {};
  arguments.rays = device.countArguments(options.rays);
  arguments.diffuse = matrixArguments(options.diffuse, options.rays.capacity);
  arguments.specular = matrixArguments(options.specular, options.rays.capacity);
  arguments.opacity = deviceAddress(options.opacity);
  return arguments;
}

}  // namespace

template <>
void VulkanDevice::enqueue(const AttentionForward& options) {
  arguments::AttentionArguments arguments = attentionArguments(*this, options);
  arguments.features = matrixArguments(options.features, options.samples.capacity);
  queue(kernel(kAttentionForwardSpirv, specialisationConstants(options.shape)), arguments,
        countGroups(options.samples, 128));
}

template <>
void VulkanDevice::enqueue(const AttentionBackward& options) {
  const size_t samples = options.samples.capacity;
  arguments::AttentionArguments arguments = attentionArguments(*this, options);
  arguments.logDensityGradients = deviceAddress(options.logDensityGradients);
  arguments.colourGradients = matrixArguments(options.colourGradients, samples);
  arguments.coarseGradients = matrixArguments(options.coarseGradients, samples);
  arguments.fineGradients = matrixArguments(options.fineGradients, samples);
  arguments.logitGradients = deviceAddress(options.logitGradients);
  queue(sumKernel(groupSpirv(kAttentionBackwardSubgroupsFloatAtomicsSpirv, kAttentionBackwardFloatAtomicsSpirv),
                  groupSpirv(kAttentionBackwardSubgroupsSpirv, kAttentionBackwardSpirv),
                  specialisationConstants(options.shape)),
        arguments, countGroups(options.samples, 256));
}

template <>
void VulkanDevice::enqueue(const ShadeForward& options) {
  arguments::ShadeArguments arguments = shadeArguments(*this, options);
  arguments.colour = deviceAddress(options.colour);
  queue(kernel(kShadeForwardSpirv, {options.whole}), arguments, countGroups(options.rays, 256, 3));
}

template <>
void VulkanDevice::enqueue(const ShadeBackward& options) {
  arguments::ShadeArguments arguments = shadeArguments(*this, options);
  arguments.colour = deviceAddress(options.colourGradients);
  arguments.sumGradients = matrixArguments(options.sumGradients, options.rays.capacity);
  arguments.opacityGradients = deviceAddress(options.opacityGradients);
  queue(kernel(kShadeBackwardSpirv, {options.whole}), arguments, countGroups(options.rays, 128));
}

}  // namespace tessera
