// Kernel arguments of the operations on the virtual grid and the lattice.
#pragma once

#include "compute/virtual_grid.h"
#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_virtual_grid.h"

namespace tessera {

inline arguments::VirtualGridArguments gridArguments(const VirtualGrid& grid) {
  CHECK(grid.voxels <= 4096u);  // products with positions in virtual_grid.glsl are exact
  CHECK(grid.planes <= 4096u);
  arguments::VirtualGridArguments arguments = {};
  arguments.voxels = grid.voxels;
  arguments.planes = grid.planes;
  arguments.corners = grid.corners();
  arguments.words = grid.words();
  arguments.quantise = grid.quantise;
  arguments.shareTexels = grid.shareTexels;
  arguments.featureRange = grid.featureRange;
  arguments.densityRange = grid.densityRange;
  return arguments;
}

// The arguments that all lookups have in common.
template <class Arguments, class Options>
Arguments VulkanDevice::lookupArguments(const Options& options) const {
  Arguments arguments = {};
  arguments.grid = gridArguments(options.grid);
  arguments.samples = countArguments(options.samples);
  arguments.texels = countArguments(options.texels);
  arguments.blockOfSample = deviceAddress(options.blockOfSample);
  arguments.positions = deviceAddress(options.positions);
  arguments.marks = deviceAddress(options.marks);
  arguments.ranks = deviceAddress(options.ranks);
  return arguments;
}

}  // namespace tessera
