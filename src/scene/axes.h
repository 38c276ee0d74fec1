// The axis conventions of the project. All modules use them; only src/import converts other conventions into them.
//
//   world    right-handed, Z up, metres where the capture has a scale; double precision
//   camera   x right, y down, z forward (COLMAP, OpenCV; "RDF")
//   pixel    (0, 0) is the outer corner of the upper left pixel, whose centre is (0.5, 0.5)
//
// Transforms are named targetFromSource and are rigid: worldFromCamera maps a point given in camera axes to the world.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tessera {

using Vec2d = Eigen::Vector2d;
using Vec3d = Eigen::Vector3d;
using Vec3f = Eigen::Vector3f;
using Mat3d = Eigen::Matrix3d;
using Mat4d = Eigen::Matrix4d;

// The largest coordinate that a file may contain. Coordinates beyond it are rejected even though they are finite,
// because their products could overflow.
inline constexpr double kFarthest = 1e12;
inline bool isPlace(const Vec3d& x) {
  return (x.array().abs() <= kFarthest).all();  // false for NaN too
}

struct Pose {
  Mat3d rotation = Mat3d::Identity();  // columns: the camera's right, down and forward in the world
  Vec3d translation = Vec3d::Zero();   // the camera's centre in the world

  Vec3d operator*(const Vec3d& x) const { return rotation * x + translation; }
  Pose inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
};

// Returns the inverse of an affine map. Its last row is (0, 0, 0, 1) exactly, as files of scenes need it; that of a
// general inverse may differ from it by a rounding error.
inline Mat4d affineInverse(const Mat4d& map) {
  return Eigen::Affine3d(map).inverse().matrix();
}

// Negates the second and third camera axis, which converts between RDF and the OpenGL axes of NeRF files (right, up,
// backward), in either direction.
inline Mat3d flippedYz(const Mat3d& rotation) {
  Mat3d flipped = rotation;
  flipped.col(1) *= -1;
  flipped.col(2) *= -1;
  return flipped;
}

}  // namespace tessera
