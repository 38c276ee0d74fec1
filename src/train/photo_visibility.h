// The viewing directions of photos, and which of their pixels are used when a model is baked.
#pragma once

#include <optional>

#include "base/image.h"
#include "scene/capture.h"
#include "train/scene_frame.h"

namespace tessera {

// Returns the viewing direction of a pixel in scene axes, of unit length; nothing where the lens sees nothing.
std::optional<Vec3d> pixelDirection(const Vec2d& pixel, const Camera& camera, const Pose& pose,
                                    const SceneFrame& frame);
// Returns the sine of the angle between the viewing direction of a pixel and the scene's horizontal plane; -1 where the
// lens sees nothing.
double elevationSine(const Vec2d& pixel, const Camera& camera, const Pose& pose, const SceneFrame& frame);
// Returns the maximum of elevationSine over all pixels of all training photos.
double maxElevationSine(const Capture& capture, const SceneFrame& frame);

// When the background block is baked, content that lies outside the photos is also kept, up to this share of their
// width and height beyond each border: viewers look around, and what the model extrapolates there is better than a
// hole.
inline constexpr double kOutOfFrameMargin = 0.5;
inline constexpr int kOutOfFrameStride = 3;  // stride of those pixels, times that of the photo's own pixels

// Returns a photo's mask, of its camera's size; an empty image if it has none. Throws Error if the mask cannot be read
// or has another size.
ImageU8 readPhotoMask(const Photo& photo, const Camera& camera);

// Decides which pixels of a photo, and outside it, show content that is to be baked.
class BakePixelFilter {
 public:
  BakePixelFilter(const Capture& capture, const SceneFrame& frame)
      : frame_(frame), maxElevationSine_(maxElevationSine(capture, frame)) {}

  // Starts a photo. Keeps references to both. Throws Error if the mask cannot be read.
  void begin(const Photo& photo, const Camera& camera);
  bool within(int x, int y) const { return x >= 0 && y >= 0 && x < camera_->width && y < camera_->height; }
  // Returns whether a pixel is used: within the photo, if the mask does not exclude it; outside, if it looks no higher
  // than some photo does: the space above that is sky, where the model's extrapolation is noise.
  bool count(int x, int y) const;

 private:
  SceneFrame frame_;
  double maxElevationSine_;
  ImageU8 mask_;
  const Photo* photo_ = nullptr;
  const Camera* camera_ = nullptr;
};

}  // namespace tessera
