// From the source's world to ours: Z up, metres where GPS says how long one is, the origin amid the cameras.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "import/exif.h"
#include "import/source.h"

namespace tessera {

// Moves poses, points, depth units and geo reference by a similarity and keeps Capture::sourceFromWorld true. Returns
// its scale (what depth maps in world units have yet to be multiplied by).
double applySimilarity(Capture& capture, const Mat4d& newFromOld);

struct Orientation {
  std::string how;   // for people: what turned the world
  double scale = 1;  // as applySimilarity
};

// In this order of trust:
//   a capture of our own          nothing is changed
//   GPS of three photos or more   east, north, up in metres (see georeference.h)
//   a source whose Z is up        only recentred
//   gimbal angles                 the mean of where they say that up is
//   camera-up vectors that agree  their mean
//   otherwise (a nadir flight)    the normal of the plane of the cameras, on the side that they look away from
// `gimbals` by photo, or empty.
Orientation orientWorld(SourceCapture& source, const std::vector<std::optional<GimbalAngles>>& gimbals);

}  // namespace tessera
