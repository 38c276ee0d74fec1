// What structure from motion knows of a photo: how far away a few of its pixels look. One number per observation.
#pragma once

#include "scene/capture.h"
#include "train/scene_frame.h"

namespace tessera {

struct KnownDistance {
  uint32_t x = 0, y = 0;  // the pixel that the observation falls in
  float distance = 0;     // from the camera, scene units
};

// [photo], empty for photos that are not trained on. Observations outside their photo, of points behind its camera
// (unless that is a fisheye), or more than `mostPixelsOff` from their point's image are left out.
std::vector<std::vector<KnownDistance>> knownDistances(const Capture& capture, const SceneFrame& frame,
                                                       double mostPixelsOff);

}  // namespace tessera
