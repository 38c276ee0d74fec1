// A camera: picture size and lens. COLMAP's lens models but its panoramas; its two fisheyes without distortion are
// OPENCV_FISHEYE without distortion here.
// Source: COLMAP's camera models (src/colmap/sensor/models.h describes the parameters).
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "scene/axes.h"
#include "scene/lens.h"

namespace tessera {

int lensParameterCount(LensModel model);
std::string_view lensName(LensModel model);  // COLMAP's name, "OPENCV_FISHEYE"
std::optional<LensModel> lensFromName(std::string_view name);
std::optional<LensModel> lensFromNumber(int number);  // COLMAP's
bool lensSeesBehind(LensModel model);                 // may see more than 90° off its axis

struct Camera {
  int width = 0, height = 0;
  LensModel lens = LensModel::pinhole;
  std::array<double, 16> parameters{};  // as COLMAP orders them; the first lensParameterCount are used

  double focalX() const;
  double focalY() const;
  double centreX() const;
  double centreY() const;

  // Unit direction in camera axes of the ray through a pixel position. Nothing where the lens model has no inverse
  // there (beyond the fold of a distortion polynomial).
  std::optional<Vec3d> directionInCamera(const Vec2d& pixel) const;
  // Pixel position of a point in camera axes; nothing when it cannot be seen (behind a perspective lens, or beyond the
  // angle where the distortion polynomial stops growing).
  std::optional<Vec2d> pixelFromCamera(const Vec3d& xInCamera) const;

  // The same lens for a picture reduced or enlarged to width × height. A lens with one focal length becomes its exact
  // equivalent with two where rounding made the pixels a little oblong.
  Camera scaledTo(int newWidth, int newHeight) const;

  bool operator==(const Camera&) const = default;
};

}  // namespace tessera
