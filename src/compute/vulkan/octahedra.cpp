#include "compute/octahedra.h"

#include <algorithm>

#include "compute/vulkan/vulkan_device.h"
#include "shaders/cell_opacities.h"
#include "shaders/compute/arguments_octahedra.h"
#include "shaders/merge_octahedra.h"
#include "shaders/octahedra_backward.h"
#include "shaders/octahedra_backward_float_atomics.h"
#include "shaders/trace_octahedra.h"
#include "shaders/trace_octahedra_float64.h"

namespace tessera {

namespace {

constexpr uint32_t kOctahedraRowsPerGroup = 64;  // local_size_x of the kernels
constexpr uint32_t kTracedRaysPerGroup = 32;     // of trace_octahedra.comp

void copyGrids(OctahedraGrids grids, arguments::OctahedraGridArguments* to) {
  CHECK((grids.size() >= 1u && grids.size() <= kMaxOctahedraGrids));
  for (const OctahedraGrid& grid : grids) {
    std::copy(grid.gridFromScene.begin(), grid.gridFromScene.end(), to->gridFromScene);
    for (int axis = 0; axis < 3; ++axis) {
      to->lowest[axis] = std::max(0.0f, grid.lowest[axis]);
      to->highest[axis] = std::min(static_cast<float>(grid.resolution), grid.highest[axis]);
    }
    std::copy(grid.positionOffset.begin(), grid.positionOffset.end(), to->positionOffset);
    to->positionScale = grid.positionScale();
    ++to;
  }
}

}  // namespace

template <>
void VulkanDevice::enqueue(const TraceOctahedra& options) {
  const RayScratch scratch = rayScratch(options.rays.capacity);
  arguments::TraceOctahedraArguments arguments = {};
  arguments.rays = countArguments(options.rays);
  arguments.resolution = options.grids[0].resolution;
  arguments.gridCount = static_cast<uint32_t>(options.grids.size());
  std::copy(options.boxInFront.begin(), options.boxInFront.end(), arguments.boxInFront);
  arguments.maximum = options.maximum;
  arguments.near = options.near;
  arguments.origins = deviceAddress(options.origins);
  arguments.directions = deviceAddress(options.directions);
  arguments.farOfRay = deviceAddress(options.farOfRay);
  arguments.displacements = deviceAddress(options.displacements);
  arguments.occupancy = deviceAddress(options.occupancy);
  arguments.keptFaces = deviceAddress(options.keptFaces);
  arguments.counts = scratch.counts;
  arguments.fitting = scratch.fitting;
  arguments.firstSample = deviceAddress(options.firstSample);
  arguments.sampleCount = deviceAddress(options.sampleCount);
  arguments.finishedRays = deviceAddress(options.finishedRays);
  arguments.rayOfSample = deviceAddress(options.rayOfSample);
  arguments.hitFaces = deviceAddress(options.faces);
  arguments.barycentrics = deviceAddress(options.barycentrics);
  arguments.positions = deviceAddress(options.positions);
  arguments.distances = deviceAddress(options.distances);
  copyGrids(options.grids, arguments.grids);
  uint32_t* to = arguments.faces;
  for (const uint32_t parity : {0u, 1u}) {
    const std::vector<ReachingFace> faces = reachingFaces(options.grids[0].placement, parity);
    arguments.faceCount = static_cast<uint32_t>(faces.size());
    CHECK(faces.size() <= arguments::kMaxReachingFaces);
    for (const ReachingFace& face : faces) {
      *to = face.local << 6;
      for (int axis = 0; axis < 3; ++axis) *to |= static_cast<uint32_t>(face.octahedron[axis] + 1) << 2 * axis;
      int shift = 11;
      for (const auto& corner : octahedronFace(face.local)) {
        uint32_t number = 0;
        for (int axis = 2; axis >= 0; --axis)
          number = 3 * number + static_cast<uint32_t>(face.octahedron[axis] + corner[axis] + 1);
        *to |= number << shift;
        shift += 5;
      }
      ++to;
    }
  }
  const Groups all = {atLeastOneGroup(options.rays.capacity, kTracedRaysPerGroup)};
  queue(realKernel(kTraceOctahedraFloat64Spirv, kTraceOctahedraSpirv, {false}), arguments, all);
  queueRunningSums(
      {options.rays, scratch.counts, arguments.sampleCount, scratch.fitting, options.sampleCapacity, scratch.partials});
  queue(realKernel(kTraceOctahedraFloat64Spirv, kTraceOctahedraSpirv, {true}), arguments, all);
  countersChanged(options.sampleCount);
  countersChanged(options.finishedRays);
}

template <>
void VulkanDevice::enqueue(const OctahedraBackward& options) {
  arguments::OctahedraBackwardArguments arguments = {};
  arguments.samples = countArguments(options.samples);
  arguments.resolution = options.grids[0].resolution;
  arguments.minCosine = options.minCosine;
  arguments.origins = deviceAddress(options.origins);
  arguments.directions = deviceAddress(options.directions);
  arguments.displacements = deviceAddress(options.displacements);
  arguments.rayOfSample = deviceAddress(options.rayOfSample);
  arguments.faces = deviceAddress(options.faces);
  arguments.barycentrics = deviceAddress(options.barycentrics);
  arguments.distances = deviceAddress(options.distances);
  arguments.positionGradients = deviceAddress(options.positionGradients);
  arguments.distanceGradients = deviceAddress(options.distanceGradients);
  arguments.displacementGradients = deviceAddress(options.displacementGradients);
  copyGrids(options.grids, arguments.grids);
  queue(sumKernel(kOctahedraBackwardFloatAtomicsSpirv, kOctahedraBackwardSpirv), arguments,
        countGroups(options.samples, kOctahedraRowsPerGroup));
}

template <>
void VulkanDevice::enqueue(const MergeOctahedra& options) {
  const uint32_t coarse = options.resolution / 2;
  CHECK(options.resolution % 2 == 0u);
  arguments::MergeOctahedraArguments arguments = {};
  arguments.resolution = options.resolution;
  arguments.points = options.points;
  arguments.listed = static_cast<uint32_t>(options.cells.count);
  arguments.offset = options.offset;
  arguments.cells = deviceAddress(options.cells);
  arguments.x = matrixArguments(options.x, size_t{options.points} * options.cells.count);
  arguments.displacements = deviceAddress(options.displacements);
  arguments.opacities = deviceAddress(options.opacities);
  arguments.merged = deviceAddress(options.mergedDisplacements);
  fillZero(options.opacities);
  queue(kernel(kCellOpacitiesSpirv), arguments, {groups(options.cells.count, kOctahedraRowsPerGroup)});
  queue(kernel(kMergeOctahedraSpirv), arguments, {groups(size_t{coarse} * coarse * coarse, kOctahedraRowsPerGroup)});
}

}  // namespace tessera
