// Which way photos look, and which of their pixels count.
#pragma once

#include <optional>

#include "base/image.h"
#include "scene/capture.h"
#include "train/scene_frame.h"

namespace tessera {

// Which way, in the scene, of unit length; nothing where the lens sees nothing.
std::optional<Vec3d> directionOf(const Vec2d& pixel, const Camera& camera, const Pose& pose, const SceneFrame& frame);
// How high a pixel looks: the sine of the angle with the scene's horizon; -1 where the lens sees nothing.
double riseOf(const Vec2d& pixel, const Camera& camera, const Pose& pose, const SceneFrame& frame);
// Of all pixels of all training photos.
double highestRise(const Capture& capture, const SceneFrame& frame);

// Of what lies around a scene also what is beside the photos is kept when it is baked, as far as this share of their
// size: people turn their heads, and what a model makes up there is better than a hole.
inline constexpr double kBesidePhotos = 0.5;
inline constexpr int kBesideStride = 3;  // of those pixels

// A photo's mask, of the photo's size; nothing where it has none. Throws Error when it cannot be read or has another
// size.
ImageU8 maskOf(const Photo& photo, const Camera& camera);

// Which pixels of photos, and beside them, show what is to be kept.
class PhotoPixels {
 public:
  PhotoPixels(const Capture& capture, const SceneFrame& frame)
      : frame_(frame), highestRise_(highestRise(capture, frame)) {}

  // Borrows both. Throws Error when the mask cannot be read.
  void begin(const Photo& photo, const Camera& camera);
  bool within(int x, int y) const { return x >= 0 && y >= 0 && x < camera_->width && y < camera_->height; }
  // Within: those that the mask does not leave out. Beside: those that look no higher than any photo; above is sky, and
  // what a model makes up there is noise.
  bool count(int x, int y) const;

 private:
  SceneFrame frame_;
  double highestRise_;
  ImageU8 mask_;
  const Photo* photo_ = nullptr;
  const Camera* camera_ = nullptr;
};

}  // namespace tessera
