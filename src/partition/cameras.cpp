#include "partition/cameras.h"

#include <Eigen/Dense>

#include "base/order_statistics.h"

namespace tessera {
namespace {

constexpr double kFarOut = 10;
constexpr double kAlongWeight = 0.001;  // of the distance along an axis, relative to that across it

}  // namespace

std::vector<int> photosTogether(const Capture& capture) {
  const std::vector<int> photos = capture.photosIn(Split::train);
  if (photos.empty()) return photos;
  Vec3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const int photo : photos) values.push_back(capture.photos[photo].worldFromCamera.translation[axis]);
    median[axis] = percentile(values, 0.5);
  }
  std::vector<double> distances;
  for (const int photo : photos) {
    distances.push_back((capture.photos[photo].worldFromCamera.translation - median).norm());
  }
  std::vector<double> sorted = distances;
  const double maximum = percentile(sorted, 0.9);
  std::vector<int> together;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (!(maximum > 0) || distances[i] <= kFarOut * maximum) together.push_back(photos[i]);
  }
  return together;
}

Vec3d findFocusPoint(const Capture& capture, const std::vector<int>& photos) {
  if (photos.empty()) return Vec3d::Zero();
  Mat3d sum = Mat3d::Zero();
  Vec3d right = Vec3d::Zero();
  for (const int photo : photos) {
    const Pose& pose = capture.photos[photo].worldFromCamera;
    const Vec3d axis = pose.rotation.col(2);
    const Mat3d across = Mat3d::Identity() - axis * axis.transpose() * (1 - kAlongWeight);
    sum += across;
    right += across * pose.translation;
  }
  return sum.ldlt().solve(right);
}

}  // namespace tessera
