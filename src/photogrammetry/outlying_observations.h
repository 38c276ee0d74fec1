// Observations that disagree with a sparse model: features that were matched wrongly, or located badly.
#pragma once

#include "import/colmap_model.h"

namespace tessera {

// Removes the observations whose reprojection error is more than three times the median of the model and the median of
// their photo, whichever is larger, then points that fewer than two photos are left to show. COLMAP's bundle adjustment
// minimises squared errors, so that a few such observations draw a photo away from where the others place it; its own
// limit, four pixels, is some twenty times what good ones have. More than half of the observations of each photo are
// within its median, so that a photo whose pose is worse than the others keeps enough to be corrected; photos with
// fewer than 30 keep all of them. Returns the number of observations that were removed.
size_t removeOutlyingObservations(ColmapModel& model);

}  // namespace tessera
