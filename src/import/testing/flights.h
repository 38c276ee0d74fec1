// Shared by the tests of orientation and georeference: flights with GPS.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>

#include "base/random.h"
#include "import/orient_world.h"

namespace tessera {

// Returns a photo that looks down, with the top of its image towards `heading`.
inline Pose nadirPose(const Vec3d& centre, double heading) {
  Pose pose;
  const Vec3d up(std::sin(heading), std::cos(heading), 0);  // up in the image
  pose.rotation.col(1) = -up;
  pose.rotation.col(2) = -Vec3d::UnitZ();
  pose.rotation.col(0) = pose.rotation.col(1).cross(pose.rotation.col(2));
  pose.translation = centre;
  return pose;
}

// Returns a grid flight of 4 × 5 photos 20 m apart at a height of 60 m, in east-north-up, with GPS errors of `noise`.
inline SourceCapture flight(double noise = 0) {
  SourceCapture source;
  const RandomStream random(7, 1);
  uint64_t draw = 0;
  const GeographicLib::LocalCartesian local(50, 8, 100);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 5; ++column) {
      Photo photo;
      const Vec3d at(20.0 * column, 20.0 * row, 60 + 3 * (column % 2));
      photo.worldFromCamera = nadirPose(at, row % 2 == 0 ? M_PI / 2 : -M_PI / 2);
      Vec3d measured = at;
      for (int axis = 0; axis < 3; ++axis) measured[axis] += noise * (random.uniformDouble(draw++) - 0.5);
      GpsFix fix;
      local.Reverse(measured.x(), measured.y(), measured.z(), fix.latitude, fix.longitude, fix.altitude);
      photo.gps = fix;
      source.capture.photos.push_back(photo);
    }
  }
  source.capture.points.push_back({Vec3d(40, 30, 0), {}, 0});
  return source;
}

// Rotates, scales and translates a capture to an arbitrary frame like that of structure from motion.
inline void scramble(SourceCapture& source) {
  Mat4d m = Mat4d::Identity();
  m.topLeftCorner<3, 3>() = 0.07 * Eigen::AngleAxisd(2, Vec3d(1, -2, 0.5).normalized()).toRotationMatrix();
  m.topRightCorner<3, 1>() = Vec3d(5, -3, 8);
  applySimilarity(source.capture, m);
  source.capture.sourceFromWorld = Mat4d::Identity();
}

inline void expectEastNorthUp(const Capture& capture, double tolerance) {
  const Vec3d step = capture.photos[1].worldFromCamera.translation - capture.photos[0].worldFromCamera.translation;
  EXPECT_NEAR((step - Vec3d(20, 0, 3)).norm(), 0, tolerance);
  for (const Photo& photo : capture.photos) EXPECT_LT(photo.worldFromCamera.rotation.col(2).z(), -0.999);
  EXPECT_NEAR(capture.points[0].xInWorld.z() - capture.photos[0].worldFromCamera.translation.z(), -60, tolerance);
}

}  // namespace tessera
