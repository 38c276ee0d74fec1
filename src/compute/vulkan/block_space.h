// Converts the block partition of a scene to kernel arguments.
#pragma once

#include "compute/blocks.h"
#include "shaders/compute/arguments_blocks.h"

namespace tessera {

inline arguments::BlockSpaceArguments spaceArguments(const BlockSpace& space) {
  return {space.columns, space.rows, space.bottom, space.top, space.near, static_cast<uint32_t>(space.backgroundBlock)};
}

}  // namespace tessera
