// The common part of ray marching in one space (MarchRays) and from block to block (MarchBlocks).
#pragma once

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_march.h"

namespace tessera {

template <class Options, class Arguments>
void VulkanDevice::queueMarch(std::span<const uint32_t> inDouble, std::span<const uint32_t> inFloat,
                              const Options& options, Arguments& arguments) {
  constexpr uint32_t kRaysPerGroup = 64;  // local_size_x of the kernels
  const RayScratch scratch = rayScratch(options.rays.capacity);
  arguments::MarchArguments& march = arguments.march;
  march.rays = countArguments(options.rays);
  march.maximum = options.maximum;
  march.maxOpticalDepth = options.maxOpticalDepth;
  march.origins = deviceAddress(options.origins);
  march.directions = deviceAddress(options.directions);
  march.jitter = deviceAddress(options.jitter);
  march.farOfRay = deviceAddress(options.farOfRay);
  march.occupancy = deviceAddress(options.occupancy);
  march.opticalDepth = deviceAddress(options.opticalDepth);
  march.nextStep = deviceAddress(options.nextStep);
  march.counts = scratch.counts;
  march.nexts = scratch.nexts;
  march.fitting = scratch.fitting;
  march.firstSample = deviceAddress(options.firstSample);
  march.sampleCount = deviceAddress(options.sampleCount);
  march.finishedRays = deviceAddress(options.finishedRays);
  march.rayOfSample = deviceAddress(options.rayOfSample);
  march.positions = deviceAddress(options.positions);
  march.distances = deviceAddress(options.distances);
  march.steps = deviceAddress(options.steps);

  const Groups all = {atLeastOneGroup(options.rays.capacity, kRaysPerGroup)};
  queue(realKernel(inDouble, inFloat, {false}), arguments, all);
  queueRunningSums(
      {options.rays, march.counts, march.sampleCount, march.fitting, options.sampleCapacity, scratch.partials});
  queue(realKernel(inDouble, inFloat, {true}), arguments, all);
  countersChanged(options.sampleCount);
  countersChanged(options.finishedRays);
}

}  // namespace tessera
