#include "compute/lattice.h"

#include "compute/vulkan/virtual_grid.h"
#include "shaders/lattice_backward.h"
#include "shaders/lattice_backward_float_atomics.h"
#include "shaders/lattice_forward.h"

namespace tessera {

namespace {

constexpr uint32_t kLatticeSamplesPerGroup = 64;  // local_size_x of the kernels

}  // namespace

template <>
void VulkanDevice::enqueue(const LatticeForward& options) {
  CHECK(options.grid.planes == 0u);
  auto arguments = lookupArguments<arguments::LatticeArguments>(options);
  arguments.values = quadAddress(options.values);
  arguments.mixed = matrixArguments(options.mixed, options.samples.capacity);
  queue(kernel(kLatticeForwardSpirv), arguments, countGroups(options.samples, kLatticeSamplesPerGroup));
}

template <>
void VulkanDevice::enqueue(const LatticeBackward& options) {
  CHECK(options.grid.planes == 0u);
  auto arguments = lookupArguments<arguments::LatticeArguments>(options);
  arguments.mixed = matrixArguments(options.mixedGradients, options.samples.capacity);
  arguments.valueGradients = deviceAddress(options.valueGradients);
  zeroRows(options.texels, LatticeForward::kColumns, options.valueGradients);
  queue(sumKernel(kLatticeBackwardFloatAtomicsSpirv, kLatticeBackwardSpirv), arguments,
        countGroups(options.samples, kLatticeSamplesPerGroup));
}

}  // namespace tessera
