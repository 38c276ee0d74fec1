// Transforms the source's world to the convention of scene/axes.h: Z up, metres where GPS gives the scale, the origin
// at the median of the cameras.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "import/exif.h"
#include "import/source.h"

namespace tessera {

// Transforms poses, points, depth units and geo reference by a similarity, and updates Capture::sourceFromWorld.
// Returns the scale of the similarity, by which the caller must multiply depth maps in world units.
double applySimilarity(Capture& capture, const Mat4d& newFromOld);

struct Orientation {
  std::string how;   // for log messages: the cue that determined the orientation
  double scale = 1;  // see applySimilarity
};

// Orients the world by the first of these cues that is available, in order of reliability:
//   a capture of our own          the world is left unchanged
//   GPS of three photos or more   east, north, up in metres (see georeference.h)
//   a source whose Z is up        the world is only recentred
//   gimbal angles                 up is the mean of the up directions that they give
//   camera-up vectors that agree  up is their mean
//   otherwise (a nadir flight)    up is the normal of the plane of the cameras, on the side that they look away from
// `gimbals` has one entry per photo, or is empty.
Orientation orientWorld(SourceCapture& source, const std::vector<std::optional<GimbalAngles>>& gimbals);

}  // namespace tessera
