// What the training cameras of a capture say together, and the order statistics that this room lives on.
#pragma once

#include <vector>

#include "scene/capture.h"

namespace tessera {

// The value at `fraction` of the order, in [0, 1]. Reorders `values`, which must not be empty.
double percentile(std::vector<double>& values, double fraction);

// Training photos, without those few that stand ten times as far from the median as nine in ten do: poses gone wrong.
std::vector<int> photosTogether(const Capture& capture);

// The point nearest to all optical axes in the least-squares sense. A little weight holds it near the cameras when the
// axes are parallel. The origin without photos.
Vec3d focusOf(const Capture& capture, const std::vector<int>& photos);

}  // namespace tessera
