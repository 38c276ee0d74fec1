// Where a capture lies on the Earth: a similarity from its world to metres east, north and up, found from the photos'
// GPS by a robust fit.
// Source: Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991, inside
// RANSAC (Fischler and Bolles, 1981).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scene/capture.h"

namespace tessera {

struct Georeference {
  GeoFrame frame;  // origin: the middle of the photos' fixes; enuFromWorld: the similarity
  int inliers = 0, fixes = 0;
  double rmsMetres = 0;  // of the inliers, in three dimensions
};

// Nothing, and why in `reason`, with fewer than three fixes, with fixes on one line (the turn about it is free) or too
// near one (standard deviation across it under kLeastGpsSpread: such a fit would be noise), or when fewer than half of
// them agree to within kGpsTolerance. Heights come from the drone's height above take-off where
// every photo has it (its barometer is far better than GPS), shifted to the mean of the absolute ones.
inline constexpr double kGpsTolerance = 8;    // metres
inline constexpr double kLeastGpsSpread = 5;  // metres
std::optional<Georeference> georeference(const std::vector<Photo>& photos, std::string& reason);

// Metres east, north, up of a fix in the frame's tangent plane.
Vec3d enuFromGps(const GeoFrame& frame, double latitude, double longitude, double altitude);

}  // namespace tessera
