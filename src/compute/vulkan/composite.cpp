#include "compute/composite.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/composite_backward.h"
#include "shaders/composite_forward.h"
#include "shaders/compute/arguments_composite.h"
#include "shaders/opaque_backward.h"
#include "shaders/opaque_forward.h"

namespace tessera {

namespace {

constexpr uint32_t kCompositeRaysPerGroup = 64;  // local_size_x of the kernels
constexpr uint32_t kMaxColumns = 16;             // see composite.glsl

// The arguments that OpaqueForward and OpaqueBackward share, except for those that need the device.
template <class Options>
arguments::OpaqueArguments opaqueArguments(const Options& options) {
  CHECK(options.maxOpacity < 1.0f);  // the backward kernel divides by what is left
  arguments::OpaqueArguments arguments = {};
  arguments.threshold = options.threshold;
  arguments.maxOpacity = options.maxOpacity;
  arguments.minOpacity = options.minOpacity;
  arguments.offset = options.offset;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.x = matrixArguments(options.x, 0);
  arguments.colours = matrixArguments(options.colours, 0);
  arguments.colour = deviceAddress(options.colour);
  return arguments;
}

}  // namespace

template <>
void VulkanDevice::enqueue(const CompositeForward& options) {
  const uint32_t columns = options.colours.columns;
  CHECK(columns <= kMaxColumns);
  arguments::CompositeForwardArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.extinction = static_cast<uint32_t>(options.extinction);
  arguments.minTransmittance = options.minTransmittance;
  arguments.offset = options.offset;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.x = matrixArguments(options.x, 0);
  arguments.steps = deviceAddress(options.steps);
  arguments.distances = deviceAddress(options.distances);
  arguments.colours = matrixArguments(options.colours, 0);
  arguments.background = deviceAddress(options.background);
  arguments.colour = deviceAddress(options.colour);
  arguments.opacity = deviceAddress(options.opacity);
  arguments.depth = deviceAddress(options.depth);
  arguments.weights = deviceAddress(options.weights);
  queue(kernel(kCompositeForwardSpirv, {columns}), arguments, countGroups(options.rays, kCompositeRaysPerGroup));
}

template <>
void VulkanDevice::enqueue(const CompositeBackward& options) {
  const uint32_t columns = options.colours.columns;
  CHECK(columns <= kMaxColumns);
  arguments::CompositeBackwardArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.extinction = static_cast<uint32_t>(options.extinction);
  arguments.minTransmittance = options.minTransmittance;
  arguments.offset = options.offset;
  arguments.fullGradientDistance = options.fullGradientDistance;
  arguments.addToXGradients = options.addToXGradients;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.x = matrixArguments(options.x, 0);
  arguments.steps = deviceAddress(options.steps);
  arguments.distances = deviceAddress(options.distances);
  arguments.colours = matrixArguments(options.colours, 0);
  arguments.background = deviceAddress(options.background);
  arguments.rayColourGradients = deviceAddress(options.rayColourGradients);
  arguments.rayOpacityGradients = deviceAddress(options.rayOpacityGradients);
  arguments.rayDepthGradients = deviceAddress(options.rayDepthGradients);
  arguments.weightGradients = deviceAddress(options.weightGradients);
  arguments.opacities = scratch(2 * std::max<size_t>(options.xGradients.count, 1));
  arguments.xGradients = deviceAddress(options.xGradients);
  arguments.colourGradients = matrixArguments(options.colourGradients, 0);
  queue(kernel(kCompositeBackwardSpirv, {columns}), arguments, countGroups(options.rays, kCompositeRaysPerGroup));
}

template <>
void VulkanDevice::enqueue(const OpaqueForward& options) {
  arguments::OpaqueArguments arguments = opaqueArguments(options);
  arguments.rays = countArguments(options.rays);
  arguments.opacity = deviceAddress(options.opacity);
  queue(kernel(kOpaqueForwardSpirv), arguments, countGroups(options.rays, kCompositeRaysPerGroup));
}

template <>
void VulkanDevice::enqueue(const OpaqueBackward& options) {
  arguments::OpaqueArguments arguments = opaqueArguments(options);
  arguments.rays = countArguments(options.rays);
  arguments.rayColourGradients = deviceAddress(options.rayColourGradients);
  arguments.xGradients = deviceAddress(options.xGradients);
  arguments.colourGradients = matrixArguments(options.colourGradients, 0);
  queue(kernel(kOpaqueBackwardSpirv), arguments, countGroups(options.rays, kCompositeRaysPerGroup));
}

}  // namespace tessera
