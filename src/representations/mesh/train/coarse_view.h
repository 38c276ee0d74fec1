// The coarse field as a camera shows it.
#pragma once

#include <optional>

#include "representations/field/train/field_renderer.h"

namespace tessera {

// Returns the camera with a pixel for each `stride` along both axes, rounded down, and at least one.
Camera strideCamera(const Camera& camera, double stride);

inline constexpr float kSolidOpacity = 0.9f;  // less opaque pixels may show several surfaces

class CoarseView {
 public:
  struct Surface {
    double depth;  // along the optical axis, world units; negative behind the camera, which some lenses see
    Vec3d at;      // in the world
  };

  // Renders the field of `renderer`.
  CoarseView(FieldRenderer& renderer, const Camera& camera, const Pose& worldFromCamera)
      : camera_(camera), worldFromCamera_(worldFromCamera), image_(renderer.render(camera, worldFromCamera, nullptr)) {}

  const Camera& camera() const { return camera_; }
  const RenderedView& image() const { return image_; }

  // Whether the depth of a pixel says how far away it is: not for rays at right angles to the optical axis.
  bool knowsDepth(int x, int y) const;
  // Returns what the middle of a pixel shows at its expected depth; nothing if it is less opaque than `opacity`, or the
  // depth is not known.
  std::optional<Surface> surfaceAt(int x, int y, float opacity) const;

 private:
  Camera camera_;
  Pose worldFromCamera_;
  RenderedView image_;
};

}  // namespace tessera
