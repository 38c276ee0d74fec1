// The heights between which a scene stands.
#pragma once

#include "partition/region.h"

namespace tessera {

// Above the ground, world units. bottom < top.
struct Heights {
  double bottom = 0, top = 0;
};

// The middle 99.6 % of the sparse points of the region, upwards also what stands on them without a gap (a lone tower is
// fewer than 0.2 % of a city), a tenth more at both ends, and the ground itself. Where the cameras look at the ground,
// points above the highest of them are no part of the scene: nothing that drones do not look down on. Cameras among
// things may have anything above them. With fewer than kEnoughGroundPoints points in the region: from a tenth of the
// height of flight below the ground up to the lowest cameras; among things, a cube about what the cameras look at.
Heights findHeights(const Capture& capture, const Ground& ground, const Region& region);

}  // namespace tessera
