// Which cells of the occupancy grid a training photo can see at all. What none sees is never trained, would be random
// when looked at from elsewhere, and is left empty (instant-ngp marks such cells too).
#pragma once

#include "compute/rays.h"
#include "scene/capture.h"
#include "scene/domain_path.h"
#include "train/scene_frame.h"

namespace tessera {

inline constexpr double kNearShare = 0.8;

// One entry a cell, in the order of MarchRays::occupancy. A cell is visible when a training photo has it in its picture
// no nearer than the photo's nearest content: with sparse points, kNearShare of the depth of the nearest ones observed
// (the free space below drones and in front of cameras then stays free); else the march's near.
// `space` is about a block: the one that fills the scene's region, or the one in `block`.
std::vector<bool> visibleCells(const Capture& capture, const SceneFrame& frame, const MarchSpace& space,
                               const BlockDomain& block = {});

// Per photo, the depth before which nothing was observed, in world units: along the optical axis, for fisheyes along
// the ray. 0 with fewer than 20 observations.
std::vector<double> nearestContent(const Capture& capture);

}  // namespace tessera
