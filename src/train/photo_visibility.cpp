#include "train/photo_visibility.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/image_io.h"

namespace tessera {
namespace {

constexpr int kPixelsAlongEdge = 64;  // pixels at which the elevation of a photo is evaluated

}  // namespace

std::optional<Vec3d> pixelDirection(const Vec2d& pixel, const Camera& camera, const Pose& pose,
                                    const SceneFrame& frame) {
  const auto inCamera = camera.directionInCamera(pixel);
  if (!inCamera) return std::nullopt;
  return frame.rotation * (pose.rotation * inCamera->normalized());
}

double elevationSine(const Vec2d& pixel, const Camera& camera, const Pose& pose, const SceneFrame& frame) {
  const auto direction = pixelDirection(pixel, camera, pose, frame);
  return direction ? direction->z() : -1;
}

double maxElevationSine(const Capture& capture, const SceneFrame& frame) {
  double highest = -1;
  for (const int photo : capture.photosIn(Split::train)) {
    const Camera& camera = capture.cameras[capture.photos[photo].camera];
    const int w = camera.width, h = camera.height;
    const Pose& pose = capture.photos[photo].worldFromCamera;
    const auto look = [&](int x, int y) {
      const Vec2d middle(x + 0.5, y + 0.5);
      highest = std::max(highest, elevationSine(middle, camera, pose, frame));
    };
    const Vec3d up = pose.rotation.transpose() * (frame.rotation.transpose() * Vec3d::UnitZ());
    const auto zenith = camera.pixelFromCamera(up);
    if (zenith && zenith->x() >= 0 && zenith->y() >= 0 && zenith->x() <= w && zenith->y() <= h) return 1;
    const int stride = std::max(1, std::max(w, h) / kPixelsAlongEdge);
    for (int x = 0; x < w + stride; x += stride) {
      for (const int y : {0, h - 1}) look(std::min(x, w - 1), y);
    }
    for (int y = 0; y < h + stride; y += stride) {
      for (const int x : {0, w - 1}) look(x, std::min(y, h - 1));
    }
  }
  return highest;
}

ImageU8 readPhotoMask(const Photo& photo, const Camera& camera) {
  if (photo.mask.empty()) return {};
  const DecodedImage decoded = readImage(photo.mask);
  if (decoded.truncated) throw Error(photo.mask.string(), "", "ends early", "import the photos again");
  if (decoded.image.width == camera.width && decoded.image.height == camera.height) return decoded.image;
  throw Error(photo.mask.string(), "",
              fmt::format("is {}x{}, its photo's camera {}x{}", decoded.image.width, decoded.image.height, camera.width,
                          camera.height),
              "import the photos again");
}

void BakePixelFilter::begin(const Photo& photo, const Camera& camera) {
  mask_ = readPhotoMask(photo, camera);
  photo_ = &photo;
  camera_ = &camera;
}

bool BakePixelFilter::count(int x, int y) const {
  if (within(x, y)) return mask_.pixels.empty() || *mask_.at(x, y) >= 128;  // the same threshold as in ray_batch.cpp
  return elevationSine({x + 0.5, y + 0.5}, *camera_, photo_->worldFromCamera, frame_) <= maxElevationSine_;
}

}  // namespace tessera
