#include "compute/cube_map.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_cube_map.h"
#include "shaders/cube_map_backward.h"
#include "shaders/cube_map_backward_float_atomics.h"
#include "shaders/cube_map_forward.h"

namespace tessera {

namespace {

constexpr uint32_t kCubeMapRaysPerGroup = 128;  // local_size_x of the kernels

template <class Options>
arguments::CubeMapArguments cubeMapArguments(const VulkanDevice& device, const Options& options) {
  CHECK(options.resolution >= 2u);
  arguments::CubeMapArguments arguments = {};
  arguments.rays = device.countArguments(options.rays);
  arguments.directions = deviceAddress(options.directions);
  arguments.resolution = options.resolution;
  return arguments;
}

}  // namespace

template <>
void VulkanDevice::enqueue(const CubeMapForward& options) {
  arguments::CubeMapArguments arguments = cubeMapArguments(*this, options);
  arguments.texels = deviceAddress(options.texels);
  arguments.colours = deviceAddress(options.colours);
  queue(kernel(kCubeMapForwardSpirv), arguments, countGroups(options.rays, kCubeMapRaysPerGroup));
}

template <>
void VulkanDevice::enqueue(const CubeMapBackward& options) {
  arguments::CubeMapArguments arguments = cubeMapArguments(*this, options);
  arguments.opacity = deviceAddress(options.opacity);
  arguments.colours = deviceAddress(options.rayColourGradients);
  arguments.texelGradients = deviceAddress(options.texelGradients);
  queue(sumKernel(kCubeMapBackwardFloatAtomicsSpirv, kCubeMapBackwardSpirv), arguments,
        countGroups(options.rays, kCubeMapRaysPerGroup));
}

}  // namespace tessera
