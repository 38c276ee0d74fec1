#include "compute/exposure.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_losses.h"
#include "shaders/exposure_backward.h"
#include "shaders/exposure_backward_float_atomics.h"
#include "shaders/exposure_forward.h"

namespace tessera {

template <>
void VulkanDevice::enqueue(const ExposureForward& options) {
  arguments::ExposureArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.colours = deviceAddress(options.colours);
  arguments.opacity = deviceAddress(options.opacity);
  arguments.background = deviceAddress(options.background);
  arguments.photoOfRay = deviceAddress(options.photoOfRay);
  arguments.logGains = deviceAddress(options.logGains);
  arguments.exposed = deviceAddress(options.exposed);
  queue(kernel(kExposureForwardSpirv), arguments, countGroups(options.rays, 256, 3));
}

template <>
void VulkanDevice::enqueue(const ExposureBackward& options) {
  arguments::ExposureArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.colours = deviceAddress(options.colours);
  arguments.background = deviceAddress(options.background);
  arguments.photoOfRay = deviceAddress(options.photoOfRay);
  arguments.logGains = deviceAddress(options.logGains);
  arguments.exposed = deviceAddress(options.exposedGradients);
  arguments.colourGradients = deviceAddress(options.colourGradients);
  arguments.opacityGradients = deviceAddress(options.opacityGradients);
  arguments.logGainGradients = deviceAddress(options.logGainGradients);
  queue(sumKernel(kExposureBackwardFloatAtomicsSpirv, kExposureBackwardSpirv), arguments,
        countGroups(options.rays, 128));
}

}  // namespace tessera
