// The one contract of everything that can draw: the training-time model, the CPU oracle, Vulkan. `eval` and `render`
// know nothing else.
#pragma once

#include <optional>
#include <string>

#include "base/image.h"
#include "scene/camera.h"

namespace tessera {

struct RenderedView {
  ImageF colour;   // 3 channels, premultiplied by opacity, in the trained sRGB space
  ImageF opacity;  // 1 channel
  // 1 channel: expected z-depth along the optical axis, premultiplied by opacity; 0 where nothing stands
  ImageF depth;
};

// The picture that people see: 3 channels, opaque.
inline ImageF compositeOver(const RenderedView& view, const Eigen::Array3f& background) {
  ImageF image = view.colour;
  for (size_t p = 0; p < image.pixelCount(); ++p) {
    for (int c = 0; c < 3; ++c) image.pixels[3 * p + c] += (1 - view.opacity.pixels[p]) * background[c];
  }
  return image;
}

class ViewRenderer {
 public:
  virtual ~ViewRenderer() = default;

  // `opaqueDepth`: z-depth of ordinary models already drawn (1 channel, the camera's size, infinity where nothing is);
  // rays end there.
  virtual RenderedView render(const Camera& camera, const Pose& worldFromCamera,
                              const ImageF* opaqueDepth = nullptr) = 0;
  // What drew it: "cpu avx3 2 threads".
  virtual std::string device() const = 0;
  // Colour behind everything, composited under the result by whoever shows it.
  virtual Eigen::Array3f background() const { return Eigen::Array3f::Zero(); }
};

}  // namespace tessera
