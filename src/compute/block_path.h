// The path of a ray through the blocks of a scene: straight line segments in the domains of the blocks, front to back.
#pragma once

#include <vector>

#include "compute/blocks.h"
#include "scene/domain_path.h"

namespace tessera {

struct BlockPiece {
  uint32_t block = 0;
  DomainSegment segment;
};

BlockDomain makeBlockDomain(const BlockSpace::Placement& placement);

// Splits a ray into the pieces that lie in each block (BlockSpace), front to back, from the larger of `near` and
// `space.near` to BlockSpace::kFarthest; a ray that enters the box begins there, as in EnterScene. Overwrites `pieces`,
// which is empty for a ray with direction zero.
void blockPath(const BlockSpace& space, const Triple<double>& origin, const Triple<double>& direction, double near,
               std::vector<BlockPiece>& pieces);

}  // namespace tessera
