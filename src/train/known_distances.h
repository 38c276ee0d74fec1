// What structure from motion knows of a photo: how far away a few of its pixels look. One number per observation.
#pragma once

#include "scene/capture.h"
#include "train/scene_frame.h"

namespace tessera {

// An observation farther from its point's image, pixels, teaches nothing.
inline constexpr double kMostPixelsOff = 2;

struct KnownDistance {
  uint32_t x = 0, y = 0;  // the pixel that the observation falls in
  float distance = 0;     // from the camera, scene units
};

// [photo], empty for photos that are not trained on. Observations outside their photo, of points behind its camera
// (unless that is a fisheye), or more than `mostPixelsOff` from their point's image are left out.
std::vector<std::vector<KnownDistance>> knownDistances(const Capture& capture, const SceneFrame& frame,
                                                       double mostPixelsOff);

// About how far the ray through a pixel of a training photo goes, in world units along it: the median of what is known
// in its part of the photo (1/kAcross of its longer edge); 0 where nothing is.
class KnownDepths {
 public:
  static constexpr int kAcross = 24;
  // Copies what it needs of `capture`. `mostPixelsOff` as above.
  KnownDepths(const Capture& capture, double mostPixelsOff);
  double operator()(int photo, const Vec2d& pixel) const;

 private:
  struct OfPhoto {
    double edge = 1;  // of a part, pixels
    int columns = 0, rows = 0;
    std::vector<float> medians;  // [rows][columns]
  };
  std::vector<OfPhoto> photos_;
};

}  // namespace tessera
