// The source of the frames that a window shows.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/vulkan/gpu_frame.h"
#include "scene/camera.h"

namespace tessera {

// Returns the same view with fewer pixels.
inline Camera inPixels(const Camera& window, double share) {
  return window.scaledTo(std::max(1, static_cast<int>(window.width * share + 0.5)),
                         std::max(1, static_cast<int>(window.height * share + 0.5)));
}

// Returns the pixel at a relative position of an image, 0 to 1 to the right and down.
inline std::pair<int, int> pixelAt(const Camera& camera, double right, double down) {
  return {static_cast<int>(std::clamp(right, 0.0, 1.0) * (camera.width - 1) + 0.5),
          static_cast<int>(std::clamp(down, 0.0, 1.0) * (camera.height - 1) + 0.5)};
}

// Returns the world position of what a pixel shows; nothing if it is less than half opaque. `depth`: along the optical
// axis, premultiplied by `opacity`.
inline std::optional<Vec3d> unprojectPixel(const Camera& camera, const Pose& worldFromCamera, std::pair<int, int> pixel,
                                           float depth, float opacity) {
  if (opacity < 0.5f) return std::nullopt;
  const std::optional<Vec3d> direction = camera.directionInCamera({pixel.first + 0.5, pixel.second + 0.5});
  if (!direction) return std::nullopt;
  return worldFromCamera * (*direction / direction->z() * (depth / opacity));
}

// The image that a window shows.
struct ShownPicture {
  GpuRenderedView onGpu;  // colour 0: there is no image yet
  // Whether the image shows the whole view that was requested, at the window's full resolution, as well as it can.
  bool isComplete = false;
  bool isNew = false;  // since the last update
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // Returns the best image of a view that is available now. `window`: a pinhole camera of the window's size; images may
  // have fewer pixels, mainly while the camera is `moving`. The image stays valid until the next update. Throws Error
  // if the model or scene cannot be read any more or the GPU fails; errors of drawing threads are rethrown here.
  virtual ShownPicture update(const Camera& window, const Pose& worldFromCamera, bool moving) = 0;

  virtual Eigen::Array3f background() const = 0;
  // Returns the world position of what the last image shows at a relative position, 0 to 1 to the right and down;
  // nothing if it is less than half opaque there. Waits for the device.
  virtual std::optional<Vec3d> placeAt(double right, double down) = 0;
  // Names and values, for display.
  using Facts = std::vector<std::pair<std::string, std::string>>;
  virtual Facts facts() const = 0;
};

}  // namespace tessera
