// A camera: picture size and lens. All twelve lens models of COLMAP.
// Source: COLMAP's camera models (src/colmap/sensor/models.h describes the parameters).
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "scene/axes.h"

namespace tessera {

// Numbered as in COLMAP's binary files.
enum class LensModel : int {
  simplePinhole = 0,           // f, cx, cy
  pinhole = 1,                 // fx, fy, cx, cy
  simpleRadial = 2,            // f, cx, cy, k
  radial = 3,                  // f, cx, cy, k1, k2
  openCv = 4,                  // fx, fy, cx, cy, k1, k2, p1, p2
  openCvFisheye = 5,           // fx, fy, cx, cy, k1, k2, k3, k4
  fullOpenCv = 6,              // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  fov = 7,                     // fx, fy, cx, cy, omega
  simpleRadialFisheye = 8,     // f, cx, cy, k
  radialFisheye = 9,           // f, cx, cy, k1, k2
  thinPrismFisheye = 10,       // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
  radTanThinPrismFisheye = 11  // fx, fy, cx, cy, k0..k5, p0, p1, s0..s3
};
inline constexpr int kLensModelCount = 12;

int lensParameterCount(LensModel model);
std::string_view lensName(LensModel model);                     // COLMAP's name, "OPENCV_FISHEYE"
std::optional<LensModel> lensFromName(std::string_view name);

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

  // The same lens for a picture reduced or enlarged to width × height.
  Camera scaledTo(int newWidth, int newHeight) const;

  bool operator==(const Camera&) const = default;
};

}  // namespace tessera
