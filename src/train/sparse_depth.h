// Sparse depths of photos from structure from motion: the distances to the points that a photo observes.
#pragma once

#include "scene/capture.h"
#include "train/scene_frame.h"

namespace tessera {

// Pixels; observations with a larger reprojection error are ignored.
inline constexpr double kMaxReprojectionError = 2;

struct SparseDepth {
  uint32_t x = 0, y = 0;  // the pixel that the observation falls in
  float distance = 0;     // from the camera, scene units
};

// Returns the sparse depths [photo], empty for photos that are not trained on. Observations that lie outside their
// photo, whose point lies behind the camera (unless it is a fisheye), or whose reprojection error is above
// `maxReprojectionError` (pixels) are ignored.
std::vector<std::vector<SparseDepth>> findSparseDepths(const Capture& capture, const SceneFrame& frame,
                                                       double maxReprojectionError);

// Estimates the distance along the ray through a pixel of a training photo, in world units: the median of the sparse
// depths in the square cell of the photo that contains it (of 1/kAcross of the longer edge); 0 if there are none.
class SparseDepthMedians {
 public:
  static constexpr int kAcross = 24;
  // Copies what it needs of `capture`. `maxReprojectionError`: see findSparseDepths.
  SparseDepthMedians(const Capture& capture, double maxReprojectionError);
  double operator()(int photo, const Vec2d& pixel) const;

 private:
  struct PhotoMedians {
    double edge = 1;  // of a cell, pixels
    int columns = 0, rows = 0;
    std::vector<float> medians;  // [rows][columns]
  };
  std::vector<PhotoMedians> photos_;
};

}  // namespace tessera
