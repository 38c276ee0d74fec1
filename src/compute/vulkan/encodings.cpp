#include "compute/encodings.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_encodings.h"
#include "shaders/frequency_backward.h"
#include "shaders/frequency_forward.h"
#include "shaders/spherical_harmonics_backward.h"
#include "shaders/spherical_harmonics_forward.h"

namespace tessera {

namespace {

template <class Options>
arguments::SphericalHarmonicsArguments harmonicsArguments(const VulkanDevice& device, const Options& options,
                                                          const Matrix<const float>& encoded) {
  CHECK(encoded.columns == static_cast<uint32_t>(options.degree * options.degree));
  arguments::SphericalHarmonicsArguments arguments = {};
  arguments.samples = device.countArguments(options.samples);
  arguments.directions = deviceAddress(options.directions);
  arguments.rayOfSample = deviceAddress(options.rayOfSample);
  arguments.encoded = matrixArguments(encoded, options.samples.capacity);
  arguments.degree = options.degree;
  return arguments;
}

template <class Options>
arguments::FrequencyArguments frequencyArguments(const VulkanDevice& device, const Options& options,
                                                 const Matrix<const float>& encoded) {
  arguments::FrequencyArguments arguments = {};
  arguments.samples = device.countArguments(options.samples);
  arguments.inputs = deviceAddress(options.inputs);
  arguments.encoded = matrixArguments(encoded, options.samples.capacity);
  arguments.dimensions = options.dimensions;
  arguments.frequencies = options.frequencies;
  return arguments;
}

}  // namespace

template <>
void VulkanDevice::enqueue(const SphericalHarmonicsForward& options) {
  queue(kernel(kSphericalHarmonicsForwardSpirv), harmonicsArguments(*this, options, options.encoded),
        countGroups(options.samples, 256, options.encoded.columns));
}

template <>
void VulkanDevice::enqueue(const SphericalHarmonicsBackward& options) {
  arguments::SphericalHarmonicsArguments arguments = harmonicsArguments(*this, options, options.encodedGradients);
  arguments.directionGradients = deviceAddress(options.directionGradients);
  queue(kernel(kSphericalHarmonicsBackwardSpirv), arguments, countGroups(options.samples, 128));
}

template <>
void VulkanDevice::enqueue(const FrequencyForward& options) {
  queue(kernel(kFrequencyForwardSpirv), frequencyArguments(*this, options, options.encoded),
        countGroups(options.samples, 256, options.encoded.columns));
}

template <>
void VulkanDevice::enqueue(const FrequencyBackward& options) {
  arguments::FrequencyArguments arguments = frequencyArguments(*this, options, options.encodedGradients);
  arguments.inputGradients = deviceAddress(options.inputGradients);
  queue(kernel(kFrequencyBackwardSpirv), arguments, countGroups(options.samples, 256, options.dimensions));
}

}  // namespace tessera
