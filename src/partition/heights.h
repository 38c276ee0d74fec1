// The vertical extent of a scene.
#pragma once

#include "partition/region.h"

namespace tessera {

// Heights above the ground, in world units; bottom < top.
struct Heights {
  double bottom = 0, top = 0;
};

// Returns the extent of the middle 99.6 % of the sparse points of the region (of those that three photos or more
// observe, if they are at least half of them: matches of two photos may be mistaken), extended upwards over further
// points that follow without a gap (a single tower has fewer than 0.2 % of a city's points), widened by a tenth at both
// ends. Where the cameras look at the ground, the extent includes the ground, and points above the highest camera are
// not part of the scene: drones look down on all of it; if more than a tenth of the region has no points, as woods have
// few, the extent reaches at least up to a quarter of the flight height. With fewer than kEnoughGroundPoints points in
// the region, the extent is from a tenth of the flight height below the ground up to the lowest cameras, or, where the
// cameras do not look at the ground, that of a cube around the point that they look at.
Heights findHeights(const Capture& capture, const Ground& ground, const Region& region);

}  // namespace tessera
