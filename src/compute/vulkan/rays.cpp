#include "compute/rays.h"

#include <cmath>

#include "compute/vulkan/march.h"
#include "shaders/compact_samples.h"
#include "shaders/compute/arguments_rays.h"
#include "shaders/generate_rays.h"
#include "shaders/march_rays.h"
#include "shaders/march_rays_float64.h"
#include "shaders/optical_depth.h"

namespace tessera {

namespace {

constexpr uint32_t kRaysPerGroup = 64;  // local_size_x of the kernels

}  // namespace

template <>
void VulkanDevice::enqueue(const GenerateRays& options) {
  arguments::GenerateRaysArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.cameras = deviceAddress(options.cameras);
  arguments.cameraOfRay = deviceAddress(options.cameraOfRay);
  arguments.pixels = deviceAddress(options.pixels);
  arguments.origins = deviceAddress(options.origins);
  arguments.directions = deviceAddress(options.directions);
  queue(kernel(kGenerateRaysSpirv), arguments, countGroups(options.rays, kRaysPerGroup));
}

template <>
void VulkanDevice::enqueue(const MarchRays& options) {
  const MarchSpace& space = options.space;
  arguments::MarchRaysArguments arguments = {};
  arguments.space.contracted = space.contracted;
  arguments.space.resolution = space.gridResolution;
  arguments.space.far = space.far;
  arguments.space.minStep = space.minStep;
  arguments.space.maxStep = space.maxStep;
  arguments.space.cone = space.cone;
  arguments.space.firstIndex = realArgumentsNotBelow(space.stepIndex(space.near));
  if (space.cone > 0) {
    const double lambda = std::log1p(static_cast<double>(space.cone)), last = space.maxStep / lambda;
    arguments.space.lambda = realArguments(lambda);
    arguments.space.linearEnd = realArguments(1 / lambda);
    arguments.space.linearDistance = realArguments(space.minStep / lambda);
    arguments.space.geometricEnd = realArguments(space.stepIndex(last));
    arguments.space.geometricDistance = realArguments(last);
  }
  queueMarch(kMarchRaysFloat64Spirv, kMarchRaysSpirv, options, arguments);
}

template <>
void VulkanDevice::enqueue(const OpticalDepth& options) {
  arguments::OpticalDepthArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.logDensity = matrixArguments(options.logDensity, 0);
  arguments.steps = deviceAddress(options.steps);
  arguments.opticalDepth = deviceAddress(options.opticalDepth);
  queue(kernel(kOpticalDepthSpirv), arguments, countGroups(options.rays, kRaysPerGroup));
}

template <>
void VulkanDevice::enqueue(const CompactSamples& options) {
  const uint32_t rays = options.rays.capacity;
  arguments::CompactSamplesArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.rounds = options.rounds;
  arguments.sampleCapacity = options.sampleCapacity;
  arguments.keptCapacity = options.keptCapacity;
  arguments.maxOpticalDepth = options.maxOpticalDepth;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.nextStep = deviceAddress(options.nextStep);
  arguments.logDensity = matrixArguments(options.logDensity, 0);
  arguments.steps = deviceAddress(options.steps);
  const RayScratch scratch = rayScratch(rays);
  arguments.counts = scratch.counts;
  arguments.fitting = scratch.fitting;
  arguments.keptFirstSample = deviceAddress(options.keptFirstSample);
  arguments.keptCount = deviceAddress(options.keptCount);
  arguments.finishedRays = deviceAddress(options.finishedRays);
  arguments.source = deviceAddress(options.source);
  arguments.rayOfSample = deviceAddress(options.rayOfSample);
  const Groups all = {atLeastOneGroup(rays, kRaysPerGroup)};
  queue(kernel(kCompactSamplesSpirv, {false}), arguments, all);
  queueRunningSums(
      {options.rays, scratch.counts, arguments.keptCount, scratch.fitting, options.keptCapacity, scratch.partials});
  queue(kernel(kCompactSamplesSpirv, {true}), arguments, all);
  countersChanged(options.keptCount);
  countersChanged(options.finishedRays);
}

VulkanDevice::RayScratch VulkanDevice::rayScratch(uint32_t rays) {
  RayScratch scratchPlaces;
  scratchPlaces.counts = scratch(2 * size_t{rays} + 2 + scanScratch(rays));
  scratchPlaces.nexts = scratchPlaces.counts + rays * sizeof(uint32_t);
  scratchPlaces.fitting = scratchPlaces.nexts + rays * sizeof(uint32_t);
  scratchPlaces.partials = scratchPlaces.fitting + 2 * sizeof(uint32_t);
  return scratchPlaces;
}

}  // namespace tessera
