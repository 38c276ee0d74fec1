// The result of the reader of one source format, for the importer: a capture in the source's own world, not yet
// compared with the files on disk.
#pragma once

#include <optional>
#include <vector>

#include "base/error.h"
#include "scene/capture.h"

namespace tessera {

struct SourceCapture {
  Capture capture;           // camera axes as in scene/axes.h, in the source's own world
  bool hasOwnSplit = false;  // Photo::split comes from the source
  bool knowsUp = false;      // the source's Z is up (NeRF files, but not those that nerfstudio makes of COLMAP's)
  bool isOurs = false;       // written by writeCapture: its world is final
  std::optional<Error> splitError;  // why Photo::split must not be used: the source's lists match none of its photos
  // By photo: whether its mask has the opposite meaning (instant-ngp's dynamic_mask: white = do not train on).
  std::vector<bool> maskIsInverted;
  // By photo: world units per unit of an EXR depth map; photos beyond the end of the vector have 1. Integer maps have
  // Photo::depthUnit.
  std::vector<double> exrUnit;
  std::vector<int> flight;  // by photo; empty: unknown
};

}  // namespace tessera
