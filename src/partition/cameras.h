// Statistics of the training cameras of a capture.
#pragma once

#include <vector>

#include "scene/capture.h"

namespace tessera {

// Returns the indices of the training photos without outliers, which have wrong poses: those more than ten times as far
// from the median position as the 90th percentile.
std::vector<int> photosTogether(const Capture& capture);

// Returns the point nearest to all optical axes in the least-squares sense, or the origin if there are no photos. A
// small weight on the distance along the axes keeps it near the cameras when the axes are parallel.
Vec3d findFocusPoint(const Capture& capture, const std::vector<int>& photos);

}  // namespace tessera
