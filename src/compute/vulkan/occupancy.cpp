#include "compute/occupancy.h"

#include "base/random.h"
#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_rays.h"
#include "shaders/occupancy_bits.h"
#include "shaders/occupancy_decay.h"
#include "shaders/occupancy_points.h"
#include "shaders/occupancy_raise.h"
#include "shaders/occupancy_samples.h"
#include "shaders/occupancy_sums.h"
#include "shaders/occupancy_sums_subgroups.h"

namespace tessera {

template <>
void VulkanDevice::enqueue(const OccupancyPoints& options) {
  const uint32_t resolution = options.space.gridResolution, points = static_cast<uint32_t>(options.cells.count);
  CHECK(16 * (uint64_t{options.first} + points) < uint64_t{1} << 32);  // random indices must not overflow
  arguments::OccupancyPointsArguments arguments = {};
  arguments.key = RandomStream(options.seed, 0x0cc).key;
  arguments.points = points;
  arguments.first = options.first;
  arguments.uniform_ = options.uniform;
  arguments.candidateCount =
      options.candidates ? static_cast<uint32_t>(options.candidates.count) : resolution * resolution * resolution;
  arguments.resolution = resolution;
  arguments.candidates = deviceAddress(options.candidates);
  arguments.occupancy = deviceAddress(options.occupancy);
  arguments.cells = deviceAddress(options.cells);
  arguments.positions = deviceAddress(options.positions);
  queue(kernel(kOccupancyPointsSpirv), arguments, {groups(points, 128)});
}

template <>
void VulkanDevice::enqueue(const OccupancyUpdate& options) {
  constexpr uint32_t kMaxSums = 256;  // maximum number of workgroups that sum
  arguments::OccupancyUpdateArguments arguments = {};
  arguments.contracted = options.space.contracted;
  arguments.resolution = options.space.gridResolution;
  arguments.minStep = options.space.minStep;
  arguments.maxStep = options.space.maxStep;
  arguments.cone = options.space.cone;
  arguments.decay = options.decay;
  arguments.threshold = options.threshold;
  arguments.points = options.points;
  arguments.cellCount = static_cast<uint32_t>(options.grid.count);
  arguments.cells = deviceAddress(options.cells);
  arguments.logDensity = matrixArguments(options.logDensity, options.points);
  arguments.grid = arguments.gridBits = deviceAddress(options.grid);
  arguments.occupancy = deviceAddress(options.occupancy);
  const uint32_t all = groups(arguments.cellCount, 256), summing = std::min(all, kMaxSums);
  arguments.partials = scratch(2 * size_t{summing} + 2);
  arguments.sums = arguments.partials + 2 * summing * sizeof(float);
  queue(kernel(kOccupancyDecaySpirv), arguments, {all});
  queue(kernel(kOccupancyRaiseSpirv), arguments, {groups(options.points, 256)});
  queue(kernel(groupSpirv(kOccupancySumsSubgroupsSpirv, kOccupancySumsSpirv)), arguments, {summing});
  addPartials(arguments.partials, summing, 2, arguments.sums);
  queue(kernel(kOccupancyBitsSpirv), arguments, {groups(arguments.cellCount / 32, 128)});
}

template <>
void VulkanDevice::enqueue(const OccupancySamples& options) {
  arguments::OccupancySamplesArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.resolution = options.resolution;
  arguments.offset = options.offset;
  arguments.minTransmittance = options.minTransmittance;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.x = matrixArguments(options.x, 0);
  arguments.positions = deviceAddress(options.positions);
  arguments.grid = arguments.gridBits = deviceAddress(options.grid);
  queue(kernel(kOccupancySamplesSpirv), arguments, countGroups(options.rays, 64));
}

}  // namespace tessera
