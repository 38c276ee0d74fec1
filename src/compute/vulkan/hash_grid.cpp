#include "compute/hash_grid.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_hash_grid.h"
#include "shaders/hash_grid_backward.h"
#include "shaders/hash_grid_backward_float_atomics.h"
#include "shaders/hash_grid_forward.h"
#include "shaders/hash_grid_position_gradients.h"

namespace tessera {

namespace {

constexpr uint32_t kHashGridInvocationsPerGroup = 128;  // local_size_x of the kernels

void setLevels(const HashGrid& grid, arguments::LevelArguments* levels) {
  CHECK(grid.levels.size() <= size_t{TESSERA_MAX_LEVELS});
  requireIndexable(grid.parameters());
  for (size_t l = 0; l < grid.levels.size(); ++l) {
    const HashGridLevel& level = grid.levels[l];
    levels[l] = {
        level.scale, level.resolution, level.entries, level.hashed, static_cast<uint32_t>(level.firstEntry), 0};
  }
}

}  // namespace

template <>
void VulkanDevice::enqueue(const HashGridForward& options) {
  const HashGrid& grid = options.grid;
  CHECK(options.encoded.columns == grid.columns());
  arguments::HashGridForwardArguments arguments = {};
  arguments.samples = partArguments(options.samples);
  arguments.positions = deviceAddress(options.positions);
  arguments.table = quadAddress(options.table);
  arguments.encoded = matrixArguments(options.encoded, options.samples.capacity);
  setLevels(grid, arguments.levels);
  queue(kernel(kHashGridForwardSpirv, {static_cast<uint32_t>(grid.features)}), arguments,
        countGroups(options.samples, kHashGridInvocationsPerGroup, 1, static_cast<uint32_t>(grid.levels.size())));
}

template <>
void VulkanDevice::enqueue(const HashGridBackward& options) {
  const HashGrid& grid = options.grid;
  CHECK(options.encodedGradients.columns == grid.columns());
  arguments::HashGridBackwardArguments arguments = {};
  arguments.samples = partArguments(options.samples);
  arguments.positions = deviceAddress(options.positions);
  arguments.table = quadAddress(options.table);
  arguments.tableGradients = deviceAddress(options.tableGradients);
  arguments.positionGradients = deviceAddress(options.positionGradients);
  arguments.encodedGradients = matrixArguments(options.encodedGradients, options.samples.capacity);
  arguments.levelCount = static_cast<uint32_t>(grid.levels.size());
  setLevels(grid, arguments.levels);

  const std::vector<uint32_t> constants = {static_cast<uint32_t>(grid.features)};
  if (options.tableGradients) {
    queue(sumKernel(kHashGridBackwardFloatAtomicsSpirv, kHashGridBackwardSpirv, constants), arguments,
          countGroups(options.samples, kHashGridInvocationsPerGroup, 2 * static_cast<uint32_t>(grid.features),
                      arguments.levelCount));
  }
  if (options.positionGradients) {
    queue(kernel(kHashGridPositionGradientsSpirv, constants), arguments,
          countGroups(options.samples, kHashGridInvocationsPerGroup));
  }
}

}  // namespace tessera
