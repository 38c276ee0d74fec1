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

// What a photo tells of the up direction.
struct UprightTags {
  std::optional<GimbalAngles> gimbal;
  int orientation = 1;  // of EXIF, 1 to 8: how viewers turn the picture
};

// Orients the world by the first of these cues that is available, in order of reliability:
//   a capture of our own          the world is left unchanged
//   GPS of three photos or more   east, north, up in metres (see georeference.h)
//   a source whose Z is up        the world is only recentred
//   gimbal angles                 up is the mean of the up directions that they give
//   camera-up vectors that agree  up is their mean; of pictures that viewers turn, it is turned, too
//   otherwise (a nadir flight)    up is the normal of the plane of the cameras, on the side that they look away from
// `tags` has one entry per photo, or is empty.
Orientation orientWorld(SourceCapture& source, const std::vector<UprightTags>& tags);

}  // namespace tessera
