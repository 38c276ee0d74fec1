// The interface of all renderers: the training-time model, the CPU reference renderer, Vulkan. `eval` and `render` use
// only this interface.
#pragma once

#include <optional>
#include <string>

#include "base/image.h"
#include "scene/camera.h"

namespace tessera {

struct RenderedView {
  ImageF colour;   // 3 channels, premultiplied by opacity, in the trained sRGB space
  ImageF opacity;  // 1 channel
  // 1 channel: expected z-depth along the optical axis, premultiplied by opacity; 0 where the ray hits nothing
  ImageF depth;
};

// Returns a view of the camera's size that shows nothing.
inline RenderedView makeEmptyView(const Camera& camera) {
  return {ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
          ImageF(camera.width, camera.height, 1)};
}

// Returns what a background colour adds to each pixel of the view: 3 channels.
inline ImageF backgroundBehind(const RenderedView& view, const Eigen::Array3f& background) {
  ImageF behind(view.opacity.width, view.opacity.height, 3);
  for (size_t p = 0; p < behind.pixelCount(); ++p) {
    for (int c = 0; c < 3; ++c) behind.pixels[3 * p + c] = (1 - view.opacity.pixels[p]) * background[c];
  }
  return behind;
}

// Composites the view over a background colour. Returns the final image: 3 channels, opaque.
inline ImageF compositeOver(const RenderedView& view, const Eigen::Array3f& background) {
  ImageF image = backgroundBehind(view, background);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] += view.colour.pixels[i];
  return image;
}

class ViewRenderer {
 public:
  virtual ~ViewRenderer() = default;

  // Renders one view. Rays end at `opaqueDepth`, the z-depth of opaque geometry that has already been rendered (1
  // channel, the camera's size, infinity where there is none).
  virtual RenderedView render(const Camera& camera, const Pose& worldFromCamera,
                              const ImageF* opaqueDepth = nullptr) = 0;
  // Returns why views of this camera cannot be rendered; nothing if they can.
  virtual std::string whyNotThrough(const Camera&) const { return ""; }
  // Returns a description of the device that renders, such as "cpu avx3 2 threads".
  virtual std::string device() const = 0;
  // Returns the colour of the background, which the caller composites under the rendered view.
  virtual Eigen::Array3f background() const { return Eigen::Array3f::Zero(); }
  // Returns false if only the region is rendered, and pixels stay transparent that show what lies outside of it.
  virtual bool showsOutside() const { return true; }
};

}  // namespace tessera
