// What the matches of a model say about how its cameras moved.
#pragma once

#include "import/colmap_model.h"

namespace tessera {

// Whether a camera that only turns explains where the photos of a model show its points: to 0.1 % of their longer
// side, with one of the usual focal lengths. Such photos show no depth. The mapper makes models of them nevertheless,
// with a wrong focal length, in which the camera passes a plane. False if no two photos share 20 points.
bool onlyTurns(const ColmapModel& model);

}  // namespace tessera
