#include "train/scene_frame.h"

#include <Eigen/Dense>
#include <algorithm>

#include "base/log.h"
#include "base/order_statistics.h"

namespace tessera {
namespace {

constexpr size_t kEnoughPoints = 200;
constexpr double kFarOut = 10;  // times as far out as nine cameras in ten: taken for a wrong pose

SceneFrame frameOfPoints(const Capture& capture) {
  Vec3d low, high;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    values.reserve(capture.points.size());
    for (const SparsePoint& point : capture.points) values.push_back(point.xInWorld[axis]);
    low[axis] = percentile(values, 0.02);
    high[axis] = percentile(values, 0.98);
  }
  return {(low + high) / 2, 2 / std::max(1e-9, (high - low).maxCoeff()), Mat3d::Identity()};
}

// Returns all photos except those so far out that they would make the scene of all others tiny.
std::vector<const Photo*> photosTogether(const Capture& capture) {
  Vec3d median = Vec3d::Zero();
  for (int axis = 0; axis < 3 && !capture.photos.empty(); ++axis) {
    std::vector<double> values;
    for (const Photo& photo : capture.photos) values.push_back(photo.worldFromCamera.translation[axis]);
    median[axis] = percentile(values, 0.5);
  }
  std::vector<double> distances;
  for (const Photo& photo : capture.photos) distances.push_back((photo.worldFromCamera.translation - median).norm());
  std::vector<double> sorted = distances;
  const double maximum = sorted.empty() ? 0 : percentile(sorted, 0.9);
  std::vector<const Photo*> together;
  std::string first;
  for (size_t i = 0; i < distances.size(); ++i) {
    if (maximum > 0 && distances[i] > kFarOut * maximum) {
      if (first.empty()) first = capture.photos[i].name;
    } else {
      together.push_back(&capture.photos[i]);
    }
  }
  if (together.size() < distances.size()) {
    warn(
        "{} photos stand more than {} times as far out as nine in ten do ({}, ...): the region of interest is fitted "
        "without them",
        distances.size() - together.size(), kFarOut, first);
  }
  return together;
}

SceneFrame frameOfCameras(const Capture& capture) {
  // The point nearest to all optical axes in the least-squares sense; a small weight along the axes keeps it near the
  // cameras if the axes are parallel.
  Mat3d sum = Mat3d::Zero();
  Vec3d right = Vec3d::Zero();
  const std::vector<const Photo*> photos = photosTogether(capture);
  for (const Photo* photo : photos) {
    const Vec3d axis = photo->worldFromCamera.rotation.col(2);
    const Mat3d across = Mat3d::Identity() - axis * axis.transpose() * 0.999;
    sum += across;
    right += across * photo->worldFromCamera.translation;
  }
  SceneFrame frame;
  if (!photos.empty()) frame.centre = sum.ldlt().solve(right);
  double reach = 0;
  for (const Photo* photo : photos) {
    reach = std::max(reach, (photo->worldFromCamera.translation - frame.centre).lpNorm<Eigen::Infinity>());
  }
  constexpr double kAtOnePlace = 1e-9;  // then nothing tells the scale
  frame.scale = 1 / (reach > kAtOnePlace ? reach : 1);
  return frame;
}

}  // namespace

SceneFrame fitSceneFrame(const Capture& capture, double margin) {
  SceneFrame frame = capture.points.size() >= kEnoughPoints ? frameOfPoints(capture) : frameOfCameras(capture);
  frame.scale /= margin;
  return frame;
}

RayCamera makeRayCamera(const Camera& camera, const Pose& worldFromCamera, const SceneFrame& frame) {
  RayCamera rayCamera;
  rayCamera.lens = static_cast<int32_t>(camera.lens);
  for (int i = 0; i < 16; ++i) rayCamera.parameters[i] = static_cast<float>(camera.parameters[i]);
  const Mat3d sceneFromCamera = frame.rotation * worldFromCamera.rotation;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rayCamera.rotation[3 * i + j] = static_cast<float>(sceneFromCamera(i, j));
  }
  const Vec3d centre = frame.sceneFromWorld(worldFromCamera.translation);
  for (int i = 0; i < 3; ++i) rayCamera.centre[i] = static_cast<float>(centre[i]);
  return rayCamera;
}

}  // namespace tessera
