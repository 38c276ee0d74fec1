#include "compute/deferred.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_deferred.h"
#include "shaders/deferred_backward.h"
#include "shaders/deferred_forward.h"
#include "shaders/deferred_weight_gradients.h"
#include "shaders/deferred_weight_gradients_float_atomics.h"

namespace tessera {

namespace {

constexpr uint32_t kSegmentsPerGroup = 64;  // local_size_x of the kernels that take segments or rays
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

}  // namespace

template <>
void VulkanDevice::enqueue(const DeferredForward& options) {
  arguments::DeferredArguments arguments = deferredArguments(*this, options);
  arguments.specular = deviceAddress(options.specular);
  queue(kernel(kDeferredForwardSpirv), arguments, countGroups(options.segments, kSegmentsPerGroup));
}

template <>
void VulkanDevice::enqueue(const DeferredBackward& options) {
  const size_t segments = options.segments.capacity;
  if (segments == 0) return;
  requireIndexable(segments * kNumbers);
  arguments::DeferredArguments arguments = deferredArguments(*this, options);
  arguments.specular = deviceAddress(options.specularGradients);
  arguments.compositedGradients = deviceAddress(options.compositedGradients);
  arguments.networkGradients = deviceAddress(options.networkGradients);
  arguments.layers = scratch(segments * kNumbers);
  queue(kernel(kDeferredBackwardSpirv), arguments, countGroups(options.segments, kSegmentsPerGroup));
  const auto networks = static_cast<uint32_t>(options.networks.count / DeferredNetwork::kParameters);
  queue(sumKernel(kDeferredWeightGradientsFloatAtomicsSpirv, kDeferredWeightGradientsSpirv), arguments,
        countGroups(options.segments, kShare, 1, networks));
}

}  // namespace tessera
