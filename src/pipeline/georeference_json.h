// poses/georeference.json: what GPS says of the poses. The stage `georeferencing` writes it, and `report` reads it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "import/georeference.h"
#include "import/source.h"

namespace tessera {

struct GeoreferenceFile {
  struct Residual {
    std::string photo;  // its name, as UTF-8
    int flight = 0;
    Vec3d position = Vec3d::Zero();   // of the camera by its pose: metres east, north and up
    Vec3d metres = Vec3d::Zero();     // east, north and up, of the fix from the pose
    Vec3d predicted = Vec3d::Zero();  // their standard deviations
    bool isInlier = false;
  };
  // As in Georeference.
  bool hasAltitudes = true, ignoresTakeOff = false;
  int inliers = 0, fixes = 0;
  double rmsMetres = 0;
  double horizontalDeviation = 0, verticalDeviation = 0;
  double scaleError = 0, rotationError = 0, middleError = 0;
  std::vector<double> heightsTooHigh;  // by flight
  std::optional<Georeference::Bend> bend;
  bool isBent = false;
  std::vector<Residual> residuals;
  std::string reason;  // why there is no georeference, and nothing of the above; empty if there is one
};

// Writes the fit to the photos of `source`, or, if there is none, the reason.
void writeGeoreference(const fs::path& file, const std::optional<Georeference>& fit, const std::string& reason,
                       const SourceCapture& source);

// Throws Error naming the file if it is missing or damaged.
GeoreferenceFile readGeoreference(const fs::path& file);

// Returns a warning that names the photos whose GPS fixes disagree with their poses; empty if all agree.
std::string describeDisagreeing(const GeoreferenceFile& georeference);

}  // namespace tessera
