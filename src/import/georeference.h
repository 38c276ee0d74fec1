// Georeferencing of a capture: a similarity from its world to metres east, north and up, fitted robustly to the photos'
// GPS fixes.
// Source: Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991, inside
// RANSAC (Fischler and Bolles, 1981).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scene/capture.h"

namespace tessera {

struct Georeference {
  struct Residual {
    int photo = 0;                 // index into the photos
    Vec3d metres = Vec3d::Zero();  // east, north and up, of the fix from the pose; the height of its flight corrected
    Vec3d predicted = Vec3d::Zero();  // their standard deviations
    bool isInlier = false;
  };
  // How the heights of the fixes bend from the middle of the photos to the farthest: metres, and their standard error.
  struct Bend {
    double metres = 0, error = 0;
  };

  // Origin: the median latitude and longitude and the mean altitude of the photos' fixes; enuFromWorld: the similarity.
  GeoFrame frame;
  bool hasAltitudes = true;  // false: most fixes state none, and all altitudes are taken to be 0
  // Whether heights above take-off fit the poses clearly worse than absolute altitudes, and are not used.
  bool ignoresTakeOff = false;
  int inliers = 0, fixes = 0;
  double rmsMetres = 0;                // of the inliers, in three dimensions
  std::vector<double> heightsTooHigh;  // by flight: metres by which its altitudes are too high, corrected
  std::vector<Residual> residuals;     // of the fixes that are used
  // Standard deviations of a fix, metres: of each horizontal coordinate, and of the height, from the residuals.
  double horizontalDeviation = 0, verticalDeviation = 0;
  // Standard errors of the similarity, if the errors of fixes are independent (those of a flight seldom are: it is then
  // off by what they share): relative, degrees, and metres at the middle of the photos.
  double scaleError = 0, rotationError = 0, middleError = 0;
  std::optional<Bend> bend;  // nothing if there are too few photos to tell

  // Whether the heights bend by more than the errors of fixes explain. The poses then form a dome or a bowl, as those
  // of photos that all look straight down do if the lens is not known.
  bool isBent() const;
};

inline constexpr double kGpsTolerance = 8;  // metres
inline constexpr double kMinGpsSpread = 5;  // metres

// Returns the similarity from the photos' world to metres east, north and up. Returns nothing, with the reason in
// `reason`, if there are fewer than three fixes, if they lie on one line (the rotation about it is undetermined) or too
// near one (standard deviation across it below kMinGpsSpread, where the fit would follow noise), if fewer than half of
// them agree within kGpsTolerance, if those that agree lie so, or if the residual exceeds a third of that deviation.
// Altitudes are the drone's heights above take-off where nine of ten fixes have one (its barometer is far more precise
// than GPS; the other fixes are not used then), shifted to agree with the median of the absolute altitudes; but the
// absolute ones if these fit the poses clearly better, as those of flights that took off at other heights do.
// Horizontal coordinates and heights count by their deviations from the fit. If only some fixes lack an absolute
// altitude, they are not used, unless heights above take-off are. `flights`: the flight of each photo, from 0 on;
// empty: all are of one. Altitudes of one flight may be wrong by the same height (GPS jumps, and take-off places
// differ), which is estimated for flights of three fixes or more.
std::optional<Georeference> georeference(const std::vector<Photo>& photos, const std::vector<int>& flights,
                                         std::string& reason);

// Returns a frame whose origin is the median latitude and longitude of the fixes, at altitude 0: a place among them,
// also across the antimeridian and with wild fixes. With the identity as similarity.
GeoFrame frameAround(const std::vector<GpsFix>& fixes);

// Returns the position of a fix in the frame's tangent plane: metres east, north and up. Latitude and longitude are in
// degrees (WGS 84), the altitude in metres with the same reference as the frame's.
Vec3d enuFromGps(const GeoFrame& frame, double latitude, double longitude, double altitude);

}  // namespace tessera
