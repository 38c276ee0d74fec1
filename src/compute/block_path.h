// A ray through the blocks of a scene: straight pieces of their domains, front to back.
#pragma once

#include <vector>

#include "compute/blocks.h"
#include "scene/domain_path.h"

namespace tessera {

struct BlockPiece {
  uint32_t block = 0;
  DomainSegment segment;
};

BlockDomain domainOf(const BlockSpace::Placement& placement);

// The pieces that the blocks own of the ray (BlockSpace), from `near` or the space's own, whichever is farther, to
// BlockSpace::kFarthest; not before the box is entered, where it is (as EnterScene). `pieces` is overwritten; no ray
// has any without a direction.
void blockPath(const BlockSpace& space, const Triple<double>& origin, const Triple<double>& direction, double near,
               std::vector<BlockPiece>& pieces);

}  // namespace tessera
