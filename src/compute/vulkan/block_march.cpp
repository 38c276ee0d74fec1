#include "compute/block_march.h"

#include "compute/vulkan/block_space.h"
#include "compute/vulkan/march.h"
#include "shaders/march_blocks.h"
#include "shaders/march_blocks_float64.h"

namespace tessera {

template <>
void VulkanDevice::enqueue(const MarchBlocks& options) {
  arguments::MarchBlocksArguments arguments = {};
  arguments.space = spaceArguments(options.space);
  arguments.cells = options.cells;
  arguments.step = options.step;
  arguments.nearOfRay = deviceAddress(options.nearOfRay);
  arguments.slotOfBlock = deviceAddress(options.slotOfBlock);
  arguments.slotOfSample = deviceAddress(options.slotOfSample);
  arguments.middles = deviceAddress(options.middles);
  arguments.widths = deviceAddress(options.widths);
  queueMarch(kMarchBlocksFloat64Spirv, kMarchBlocksSpirv, options, arguments);
}

}  // namespace tessera
