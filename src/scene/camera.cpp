#include "scene/camera.h"

#include <algorithm>

#include "base/check.h"

namespace tessera {
namespace {

struct LensFacts {
  LensModel model;
  std::string_view name;
  int parameters;
  bool oneFocal;
  bool seesBehind = false;
};

constexpr std::array<LensFacts, std::size(kLensModels)> kLenses = {{
    {LensModel::simplePinhole, "SIMPLE_PINHOLE", 3, true},
    {LensModel::pinhole, "PINHOLE", 4, false},
    {LensModel::simpleRadial, "SIMPLE_RADIAL", 4, true},
    {LensModel::radial, "RADIAL", 5, true},
    {LensModel::openCv, "OPENCV", 8, false},
    {LensModel::openCvFisheye, "OPENCV_FISHEYE", 8, false, true},
    {LensModel::fullOpenCv, "FULL_OPENCV", 12, false},
    {LensModel::fov, "FOV", 5, false},
    {LensModel::simpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", 4, true, true},
    {LensModel::radialFisheye, "RADIAL_FISHEYE", 5, true, true},
    {LensModel::thinPrismFisheye, "THIN_PRISM_FISHEYE", 12, false, true},
    {LensModel::radTanThinPrismFisheye, "RAD_TAN_THIN_PRISM_FISHEYE", 16, false, true},
    {LensModel::simpleDivision, "SIMPLE_DIVISION", 4, true, true},
    {LensModel::division, "DIVISION", 5, false, true},
    {LensModel::eucm, "EUCM", 6, false, true},
}};

const LensFacts& lensFacts(LensModel model) {
  const auto match =
      std::find_if(kLenses.begin(), kLenses.end(), [model](const LensFacts& l) { return l.model == model; });
  CHECK(match != kLenses.end());
  return *match;
}

// Returns the model with two focal lengths that generalises a model with one, with the same distortion.
LensModel withTwoFocals(LensModel model) {
  switch (model) {
    case LensModel::simplePinhole:
      return LensModel::pinhole;
    case LensModel::simpleRadial:
    case LensModel::radial:
      return LensModel::openCv;
    case LensModel::simpleRadialFisheye:
    case LensModel::radialFisheye:
      return LensModel::openCvFisheye;
    case LensModel::simpleDivision:
      return LensModel::division;
    default:
      return model;
  }
}

}  // namespace

int lensParameterCount(LensModel model) {
  return lensFacts(model).parameters;
}
std::string_view lensName(LensModel model) {
  return lensFacts(model).name;
}

bool isPinhole(LensModel model) {
  return model == LensModel::pinhole || model == LensModel::simplePinhole;
}

bool lensSeesBehind(LensModel model) {
  return lensFacts(model).seesBehind;
}

std::optional<LensModel> lensFromName(std::string_view name) {
  for (const LensFacts& lens : kLenses) {
    if (lens.name == name) return lens.model;
  }
  return std::nullopt;
}

std::optional<LensModel> lensFromNumber(int number) {
  for (const LensModel model : kLensModels) {
    if (static_cast<int>(model) == number) return model;
  }
  return std::nullopt;
}

double Camera::focalX() const {
  return parameters[0];
}
double Camera::focalY() const {
  return parameters[lensFacts(lens).oneFocal ? 0 : 1];
}
double Camera::centreX() const {
  return parameters[lensFacts(lens).oneFocal ? 1 : 2];
}
double Camera::centreY() const {
  return parameters[lensFacts(lens).oneFocal ? 2 : 3];
}

std::optional<Vec3d> Camera::directionInCamera(const Vec2d& pixel) const {
  Vec3d direction;
  if (!lensUnproject(lens, parameters.data(), pixel.x(), pixel.y(), direction.data())) return std::nullopt;
  return direction;
}

std::optional<Vec2d> Camera::pixelFromCamera(const Vec3d& xInCamera) const {
  Vec2d pixel;
  if (!lensProject(lens, parameters.data(), xInCamera.data(), pixel.data())) return std::nullopt;
  return pixel;
}

Camera Camera::scaledTo(int newWidth, int newHeight) const {
  CHECK(width > 0);
  CHECK(height > 0);
  const double scaleX = static_cast<double>(newWidth) / width, scaleY = static_cast<double>(newHeight) / height;
  Camera scaled = *this;
  scaled.width = newWidth;
  scaled.height = newHeight;
  if (lensFacts(lens).oneFocal) {
    if (scaleX != scaleY) {
      scaled.lens = withTwoFocals(lens);
      scaled.parameters = {};
      scaled.parameters[0] = scaled.parameters[1] = parameters[0];
      std::copy(parameters.begin() + 1, parameters.begin() + lensParameterCount(lens), scaled.parameters.begin() + 2);
    } else {
      for (int i : {0, 1, 2}) scaled.parameters[static_cast<size_t>(i)] *= scaleX;
      return scaled;
    }
  }
  scaled.parameters[0] *= scaleX;
  scaled.parameters[1] *= scaleY;
  scaled.parameters[2] *= scaleX;
  scaled.parameters[3] *= scaleY;
  return scaled;
}

}  // namespace tessera
