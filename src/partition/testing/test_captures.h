// Small captures with known footprints, for tests.
#pragma once

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "scene/capture.h"

namespace tessera {

inline constexpr double kDegree = std::numbers::pi / 180;

// Returns a photo taken at `from` and looking at `to`, with `up` pointing up in the image.
inline Photo lookingAt(const Vec3d& from, const Vec3d& to, const Vec3d& up) {
  Photo photo;
  const Vec3d forward = (to - from).normalized(), right = forward.cross(up).normalized();
  photo.worldFromCamera.rotation << right, forward.cross(right), forward;
  photo.worldFromCamera.translation = from;
  return photo;
}

// Returns a capture without photos, with a pinhole camera of 400 × 300 pixels and focal length 200: looking straight
// down from height h it shows 2h × 1.5h.
inline Capture emptyCapture() {
  Capture capture;
  Camera camera;
  camera.width = 400;
  camera.height = 300;
  camera.parameters = {200, 200, 200, 150};
  capture.cameras.push_back(camera);
  return capture;
}

inline void addPhoto(Capture& capture, Photo photo) {
  photo.name = "photo_" + std::to_string(capture.photos.size());
  capture.photos.push_back(std::move(photo));
}

// Returns a photo that looks straight down from (x, y, height), with image rows along x.
inline Photo lookingDown(double x, double y, double height) {
  return lookingAt({x, y, height}, {x, y, height - 1}, Vec3d::UnitY());
}

// Returns columns × rows photos that look straight down from `height`, `step` apart, the first above (0, 0).
inline Capture flight(int columns, int rows, double step, double height) {
  Capture capture = emptyCapture();
  for (int i = 0; i < columns * rows; ++i) {
    addPhoto(capture, lookingDown(step * (i % columns), step * (i / columns), height));
  }
  return capture;
}

// Returns `count` photos from a circle of `radius` around `centre`, alternately slightly above and below it, all
// looking at the centre.
inline Capture orbit(const Vec3d& centre, double radius, int count) {
  Capture capture = emptyCapture();
  for (int i = 0; i < count; ++i) {
    const double angle = 360 * kDegree * i / count;
    const Vec3d from = centre + radius * Vec3d(std::cos(angle), std::sin(angle), i % 2 ? 0.05 : -0.05);
    addPhoto(capture, lookingAt(from, centre, Vec3d::UnitZ()));
  }
  return capture;
}

inline void addPoints(Capture& capture, int count, const Vec3d& low, const Vec3d& high, uint64_t seed = 1) {
  const RandomStream random(seed, 2);
  for (int i = 0; i < count; ++i) {
    SparsePoint point;
    for (int axis = 0; axis < 3; ++axis) {
      point.xInWorld[axis] = low[axis] + (high - low)[axis] * random.uniformDouble(3 * static_cast<uint64_t>(i) + axis);
    }
    capture.points.push_back(point);
  }
}

// Rotates the capture about the world's origin, together with its geo reference if it has one.
inline void turn(Capture& capture, const Mat3d& rotation) {
  for (Photo& photo : capture.photos) {
    photo.worldFromCamera.rotation = rotation * photo.worldFromCamera.rotation;
    photo.worldFromCamera.translation = rotation * photo.worldFromCamera.translation;
  }
  for (SparsePoint& point : capture.points) point.xInWorld = rotation * point.xInWorld;
  if (capture.geo) capture.geo->enuFromWorld.topLeftCorner<3, 3>() *= rotation.transpose();
}

inline Mat3d turnAbout(const Vec3d& axis, double degrees) {
  return Eigen::AngleAxisd(degrees * kDegree, axis.normalized()).toRotationMatrix();
}

inline double degreesBetween(const Vec3d& a, const Vec3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kDegree;
}

}  // namespace tessera
