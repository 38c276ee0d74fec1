// A camera: image size and lens. Supports COLMAP's lens models except its panoramas; its two fisheye models without
// distortion are represented as OPENCV_FISHEYE without distortion.
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
std::optional<LensModel> lensFromNumber(int number);  // COLMAP's number of the model
bool isPinhole(LensModel model);                      // without distortion: lines stay lines
bool lensSeesBehind(LensModel model);                 // whether it may see more than 90° off its axis

struct Camera {
  int width = 0, height = 0;
  LensModel lens = LensModel::pinhole;
  std::array<double, 16> parameters{};  // as COLMAP orders them; the first lensParameterCount are used

  // Focal lengths and principal point in pixels, in the convention of scene/axes.h.
  double focalX() const;
  double focalY() const;
  double centreX() const;
  double centreY() const;

  // Returns the unit direction, in camera axes, of the ray through a pixel position, or nothing where the lens model
  // has no inverse (beyond the fold of a distortion polynomial).
  std::optional<Vec3d> directionInCamera(const Vec2d& pixel) const;
  // Returns the pixel position of a point in camera axes, or nothing if it cannot be seen (behind a perspective lens,
  // or beyond the angle where the distortion polynomial stops growing).
  std::optional<Vec2d> pixelFromCamera(const Vec3d& xInCamera) const;

  // Returns the same lens for an image resized to newWidth × newHeight. A lens with one focal length becomes its exact
  // equivalent with two where rounding of the size makes the pixels slightly oblong.
  Camera scaledTo(int newWidth, int newHeight) const;

  bool operator==(const Camera&) const = default;
};

}  // namespace tessera
