// Sparse points and the photos that saw them, as structure from motion would find them: noisy, a few of them wrong.
#pragma once

#include "scene/capture.h"
#include "synth/photographer.h"

namespace tessera {

struct TrackOptions {
  int pointsPerPhoto = 100;
  int mostPoints = 200000;
  double pixelNoise = 0.5;     // standard deviation of a keypoint, pixels
  double wrongMatches = 0.01;  // share of observations that are several pixels off
  double wrongPoints = 0.005;  // share of points metres away from any surface
  double detection = 0.75;     // chance that a visible point is found in a photo
  uint64_t seed = 0;
};

// Fills `points` and `observations` for the photos of `capture`, all taken with its only camera. Points lie on what
// stands still and does not mirror, and are seen by three photos or more.
void findTracks(const CityScene& city, const LensTable& lens, const TrackOptions& options, ThreadPool& pool,
                Capture& capture);

}  // namespace tessera
