// Finds the cells of an occupancy grid that are visible in some training photo. The other cells are never trained,
// would look random from other viewpoints, and are left empty (instant-ngp also marks such cells).
#pragma once

#include "compute/rays.h"
#include "scene/capture.h"
#include "scene/domain_path.h"
#include "train/scene_frame.h"

namespace tessera {

inline constexpr double kNearShare = 0.8;  // of a photo's nearest sparse depth, before which space is assumed empty

// Returns one entry per cell, in the order of MarchRays::occupancy. A cell is visible if it lies in the image of some
// training photo and not nearer than a minimum depth: kNearShare of nearestSparseDepth (so that the free space below
// drones and in front of cameras remains empty) or, without sparse points, the near distance of `space`. `space` is
// relative to a block: the one that fills the scene's region, or `block`.
std::vector<bool> visibleCells(const Capture& capture, const SceneFrame& frame, const MarchSpace& space,
                               const BlockDomain& block = {});

// Returns for each photo the depth before which no point was observed, ignoring outliers, in world units: along the
// optical axis or, for fisheyes, along the ray. 0 with fewer than 20 observations.
std::vector<double> nearestSparseDepth(const Capture& capture);

}  // namespace tessera
