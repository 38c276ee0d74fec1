// Sparse points and the photos that observe them, as structure from motion would produce them: noisy, with a few
// outliers.
#pragma once

#include "scene/capture.h"
#include "synth/photographer.h"

namespace tessera {

struct TrackOptions {
  int pointsPerPhoto = 100;
  int maxPoints = 200000;
  double pixelNoise = 0.5;     // standard deviation of a keypoint, pixels
  double wrongMatches = 0.01;  // fraction of observations that are several pixels off
  double wrongPoints = 0.005;  // fraction of points that are metres away from any surface
  double detection = 0.75;     // probability that a visible point is detected in a photo
  uint64_t seed = 0;
};

// Fills `points` and `observations` for the photos of `capture`, all taken with its only camera. Points lie on static
// surfaces that do not mirror, and each is observed by at least three photos.
void findTracks(const CityScene& city, const LensTable& lens, const TrackOptions& options, ThreadPool& pool,
                Capture& capture);

}  // namespace tessera
