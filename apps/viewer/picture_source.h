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
  // z-depth at a place of the last picture, 0 to 1 to the right and down; nothing where nothing stands. Waits.
  virtual std::optional<double> depthAt(double right, double down) = 0;
  // Names and values, for people.
  using Facts = std::vector<std::pair<std::string, std::string>>;
  virtual Facts facts() const = 0;
};

}  // namespace tessera
