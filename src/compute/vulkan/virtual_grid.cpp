#include "compute/vulkan/virtual_grid.h"

#include <algorithm>

#include "shaders/distinct_texels_mark.h"
#include "shaders/distinct_texels_place.h"
#include "shaders/virtual_grid_backward.h"
#include "shaders/virtual_grid_backward_float_atomics.h"
#include "shaders/virtual_grid_forward.h"
#include "shaders/zero_rows.h"

namespace tessera {

namespace {

constexpr uint32_t kLookupsPerGroup = 64;  // local_size_x of the lookups

}  // namespace

void VulkanDevice::zeroRows(const Count& rows, uint32_t columns, const Slice<float>& numbers) {
  const size_t maximum = size_t{rows.capacity} * columns;
  requireIndexable(maximum);
  queue(kernel(kZeroRowsSpirv), arguments::ZeroRowsArguments{countArguments(rows), deviceAddress(numbers), columns, 0},
        countGroups(rows, 256, columns));
}

template <>
void VulkanDevice::enqueue(const DistinctTexels& options) {
  const VirtualGrid& grid = options.grid;
  const size_t corners = size_t{options.samples.capacity} * grid.corners();
  const size_t words = size_t{options.blocks} * grid.words();
  requireIndexable(corners);
  requireIndexable(words);
  arguments::DistinctTexelsArguments arguments = {};
  arguments.grid = gridArguments(grid);
  arguments.samples = countArguments(options.samples);
  arguments.blockOfSample = deviceAddress(options.blockOfSample);
  arguments.positions = deviceAddress(options.positions);
  arguments.marks = deviceAddress(options.marks);
  arguments.ranks = deviceAddress(options.ranks);
  arguments.firstTexel = deviceAddress(options.firstTexel);
  arguments.texelPositions = deviceAddress(options.texelPositions);
  arguments.blocks = options.blocks;
  arguments.texelCapacity = options.texelCapacity;
  Groups ofCorners = countGroups(options.samples, 128, grid.corners());
  ofCorners.x = std::max(ofCorners.x, 1u);
  if (!grid.shareTexels) {
    queue(kernel(kDistinctTexelsMarkSpirv, {false}), arguments, ofCorners);
    countersChanged(options.firstTexel);
    return;
  }
  fillZero(options.marks.part(0, words));
  queue(kernel(kDistinctTexelsMarkSpirv, {true}), arguments, ofCorners);
  const uint64_t fitting = scratch(2 + scanScratch(words));
  queueRunningSums({.rows = {static_cast<uint32_t>(words)},
                    .values = arguments.ranks,
                    .total = arguments.firstTexel + options.blocks * sizeof(uint32_t),
                    .fitting = fitting,
                    .limit = kNoLimit,
                    .scratch = fitting + 2 * sizeof(uint32_t),
                    .marks = arguments.marks});
  queue(kernel(kDistinctTexelsPlaceSpirv), arguments, {groups(words, 128)});
  countersChanged(options.firstTexel);
}

template <>
void VulkanDevice::enqueue(const VirtualGridForward& options) {
  auto arguments = lookupArguments<arguments::VirtualGridLookupArguments>(options);
  arguments.attributes = quadAddress(options.attributes);
  arguments.runtimeSteps = deviceAddress(options.runtimeSteps);
  arguments.logDensities = deviceAddress(options.logDensities);
  arguments.colours = deviceAddress(options.colours);
  arguments.minAlpha = options.minAlpha;
  queue(kernel(kVirtualGridForwardSpirv, {options.grid.corners()}), arguments,
        countGroups(options.samples, kLookupsPerGroup));
}

template <>
void VulkanDevice::enqueue(const VirtualGridBackward& options) {
  auto arguments = lookupArguments<arguments::VirtualGridLookupArguments>(options);
  arguments.logDensities = deviceAddress(options.logDensities);
  arguments.colours = deviceAddress(options.colours);
  arguments.logDensityGradients = deviceAddress(options.logDensityGradients);
  arguments.colourGradients = deviceAddress(options.colourGradients);
  arguments.attributeGradients = deviceAddress(options.attributeGradients);
  zeroRows(options.texels, VirtualGrid::kAttributes, options.attributeGradients);
  queue(sumKernel(kVirtualGridBackwardFloatAtomicsSpirv, kVirtualGridBackwardSpirv, {options.grid.corners()}),
        arguments, countGroups(options.samples, kLookupsPerGroup));
}

}  // namespace tessera
