// What the reader of one outside format hands to the importer: a capture in the source's own world, not yet held
// against what is on disk.
#pragma once

#include <optional>
#include <vector>

#include "base/error.h"
#include "scene/capture.h"

namespace tessera {

struct SourceCapture {
  Capture capture;                  // poses in camera axes as scene/axes.h wants them, world as the source has it
  bool hasOwnSplit = false;         // Photo::split comes from the source
  bool knowsUp = false;             // the source's Z is up (NeRF files); COLMAP's world lies anyhow
  bool isOurs = false;              // written by writeCapture: its world is final
  std::optional<Error> splitError;  // why Photo::split must not be used: the source's lists fit none of its photos
  // Photos whose mask has the opposite meaning (instant-ngp's dynamic_mask: white = do not train on), by index.
  std::vector<bool> maskIsInverted;
  // World units per unit of an EXR depth map, by index; 1 beyond the end. Integer maps have Photo::depthUnit.
  std::vector<double> exrUnit;
};

}  // namespace tessera
