// What kernels are told of the blocks of a scene.
#pragma once

#include "compute/blocks.h"
#include "shaders/compute/arguments_blocks.h"

namespace tessera {

inline arguments::BlockSpaceArguments spaceArguments(const BlockSpace& space) {
  return {space.columns, space.rows, space.bottom, space.top, space.near, static_cast<uint32_t>(space.surround)};
}

}  // namespace tessera
