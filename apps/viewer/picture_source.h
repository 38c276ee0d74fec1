// Where a window's pictures come from.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/vulkan/gpu_picture.h"
#include "scene/camera.h"

namespace tessera {

// The same view in fewer pixels.
inline Camera inPixels(const Camera& window, double share) {
  return window.scaledTo(std::max(1, static_cast<int>(window.width * share + 0.5)),
                         std::max(1, static_cast<int>(window.height * share + 0.5)));
}

// A pixel at a place of a picture, 0 to 1 to the right and down.
inline std::pair<int, int> pixelAt(const Camera& camera, double right, double down) {
  return {static_cast<int>(std::clamp(right, 0.0, 1.0) * (camera.width - 1) + 0.5),
          static_cast<int>(std::clamp(down, 0.0, 1.0) * (camera.height - 1) + 0.5)};
}

// Where in the world something lies that a pixel shows. `depth`: along the optical axis, premultiplied by `opacity`.
inline std::optional<Vec3d> placeOf(const Camera& camera, const Pose& worldFromCamera, std::pair<int, int> pixel,
                                    float depth, float opacity) {
  if (opacity < 0.5f) return std::nullopt;
  const std::optional<Vec3d> direction = camera.directionInCamera({pixel.first + 0.5, pixel.second + 0.5});
  if (!direction) return std::nullopt;
  return worldFromCamera * (*direction / direction->z() * (depth / opacity));
}

// What a window shows of what it looks at.
struct ShownPicture {
  DrawnOnCard onCard;    // no colour: there is none yet
  bool isWhole = false;  // of the view that was asked for, all of it, in the window's own pixels
  bool isNew = false;    // since the last time
};

class PictureSource {
 public:
  virtual ~PictureSource() = default;

  // The best there is of a view by now. `window`: a pinhole camera of the window's size; pictures may have fewer
  // pixels, most of all while it is moving. The picture stays until the next update. Throws Error.
  virtual ShownPicture update(const Camera& window, const Pose& worldFromCamera, bool moving) = 0;

  virtual Eigen::Array3f background() const = 0;
  // What the last picture shows at a place of it, 0 to 1 to the right and down, in the world; nothing where less than
  // half of what is behind is hidden. Waits.
  virtual std::optional<Vec3d> placeAt(double right, double down) = 0;
  // Names and values, for people.
  using Facts = std::vector<std::pair<std::string, std::string>>;
  virtual Facts facts() const = 0;
};

}  // namespace tessera
