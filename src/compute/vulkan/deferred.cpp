#include "compute/deferred.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/blend_backward.h"
#include "shaders/blend_forward.h"
#include "shaders/compute/arguments_deferred.h"
#include "shaders/deferred_backward.h"
#include "shaders/deferred_forward.h"
#include "shaders/deferred_weight_gradients.h"
#include "shaders/deferred_weight_gradients_float_atomics.h"

namespace tessera {

namespace {

constexpr uint32_t kPerGroup = 64;  // local_size_x of the kernels that take segments or rays
constexpr uint32_t kShare = TESSERA_SEGMENTS_OF_SHARE;
constexpr size_t kNumbers = TESSERA_DEFERRED_NUMBERS;
static_assert(kNumbers == DeferredNetwork::kInputs + 4 * DeferredNetwork::kHidden + 3);

template <class Options>
arguments::DeferredArguments deferredArguments(const VulkanDevice& device, const Options& options) {
  arguments::DeferredArguments arguments = {};
  arguments.segments = device.countArguments(options.segments);
  arguments.composited = deviceAddress(options.composited);
  arguments.networkOfSegment = deviceAddress(options.networkOfSegment);
  arguments.rayOfSegment = deviceAddress(options.rayOfSegment);
  arguments.directions = deviceAddress(options.directions);
  arguments.networks = deviceAddress(options.networks);
  return arguments;
}

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

void VulkanDevice::enqueue(const DeferredForward& options) {
  arguments::DeferredArguments arguments = deferredArguments(*this, options);
  arguments.specular = deviceAddress(options.specular);
  queue(kernel(kDeferredForwardSpirv), arguments, groupsOf(options.segments, kPerGroup));
}

void VulkanDevice::enqueue(const DeferredBackward& options) {
  const size_t segments = options.segments.capacity;
  if (segments == 0) return;
  CHECK(segments * kNumbers < size_t{1} << 31);
  arguments::DeferredArguments arguments = deferredArguments(*this, options);
  arguments.specular = deviceAddress(options.specularGradients);
  arguments.compositedGradients = deviceAddress(options.compositedGradients);
  arguments.networkGradients = deviceAddress(options.networkGradients);
  arguments.layers = scratch(segments * kNumbers);
  queue(kernel(kDeferredBackwardSpirv), arguments, groupsOf(options.segments, kPerGroup));
  const auto networks = static_cast<uint32_t>(options.networks.count / DeferredNetwork::kParameters);
  queue(sumKernel(kDeferredWeightGradientsFloatAtomicsSpirv, kDeferredWeightGradientsSpirv), arguments,
        groupsOf(options.segments, kShare, 1, networks));
}

void VulkanDevice::enqueue(const BlendForward& options) {
  arguments::BlendArguments arguments = blendArguments(*this, options);
  arguments.depths = deviceAddress(options.depths);
  arguments.colour = deviceAddress(options.colour);
  arguments.opacity = deviceAddress(options.opacity);
  arguments.depth = deviceAddress(options.depth);
  queue(kernel(kBlendForwardSpirv, {options.literal}), arguments, groupsOf(options.rays, kPerGroup));
}

void VulkanDevice::enqueue(const BlendBackward& options) {
  arguments::BlendArguments arguments = blendArguments(*this, options);
  arguments.colour = deviceAddress(options.rayColourGradients);
  arguments.opacity = deviceAddress(options.rayOpacityGradients);
  arguments.transmittances = scratch(std::max<size_t>(options.opacityGradients.count, 1));
  arguments.compositedGradients = deviceAddress(options.compositedGradients);
  arguments.specularGradients = deviceAddress(options.specularGradients);
  arguments.opacityGradients = deviceAddress(options.opacityGradients);
  queue(kernel(kBlendBackwardSpirv, {options.literal}), arguments, groupsOf(options.rays, kPerGroup));
}

}  // namespace tessera
