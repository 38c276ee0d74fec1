#include "photogrammetry/outlying_observations.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <optional>
#include <unordered_map>

#include "base/order_statistics.h"

namespace tessera {
namespace {

constexpr double kMedians = 3;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr size_t kLeastViews = 2;        // of a point
constexpr size_t kFewObservations = 30;  // of a photo, with which the mapper places it at least

using PointPlaces = std::unordered_map<uint64_t, Vec3d>;

// Returns the reprojection error of each keypoint of a photo, in pixels; infinity where the point cannot be seen.
std::vector<double> reprojectionErrors(const ColmapModel::Image& image, const Camera& camera,
                                       const PointPlaces& places) {
  const auto& q = image.quaternion;
  const Eigen::Quaterniond cameraFromWorld = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
  const Vec3d shift(image.translation[0], image.translation[1], image.translation[2]);
  std::vector<double> errors;
  for (const ColmapModel::Keypoint& keypoint : image.keypoints) {
    const auto place = places.find(keypoint.point);
    const auto pixel = place == places.end() ? std::optional<Vec2d>()
                                             : camera.pixelFromCamera(cameraFromWorld * place->second + shift);
    const double error = pixel ? (*pixel - Vec2d(keypoint.x, keypoint.y)).norm() : kInfinity;
    errors.push_back(error < kInfinity ? error : kInfinity);  // not a number, too
  }
  return errors;
}

}  // namespace

size_t removeOutlyingObservations(ColmapModel& model) {
  PointPlaces places;
  for (const ColmapModel::Point& point : model.points) places.emplace(point.id, point.point.xInWorld);
  std::vector<std::vector<double>> errors(model.images.size());
  std::vector<double> all;
  for (size_t i = 0; i < model.images.size(); ++i) {
    const auto camera = model.cameras.find(model.images[i].camera);
    if (camera == model.cameras.end()) continue;
    errors[i] = reprojectionErrors(model.images[i], camera->second, places);
    all.insert(all.end(), errors[i].begin(), errors[i].end());
  }
  if (all.empty()) return 0;
  const double median = upperMedian(all);
  if (median == kInfinity) return 0;
  std::unordered_map<uint64_t, size_t> views;  // that are left
  size_t before = 0, left = 0;
  for (size_t i = 0; i < model.images.size(); ++i) {
    before += model.images[i].keypoints.size();
    if (errors[i].empty()) continue;
    std::vector<double> own = errors[i];
    const double limit = own.size() < kFewObservations ? kInfinity : kMedians * std::max(median, upperMedian(own));
    std::vector<ColmapModel::Keypoint> agreeing;
    for (size_t k = 0; k < errors[i].size(); ++k)
      if (errors[i][k] < kInfinity && errors[i][k] <= limit) agreeing.push_back(model.images[i].keypoints[k]);
    for (const ColmapModel::Keypoint& keypoint : agreeing) ++views[keypoint.point];
    model.images[i].keypoints = std::move(agreeing);
  }
  const auto isSeen = [&](uint64_t point) {
    const auto count = views.find(point);
    return count != views.end() && count->second >= kLeastViews;
  };
  for (ColmapModel::Image& image : model.images) {
    std::erase_if(image.keypoints, [&](const ColmapModel::Keypoint& keypoint) { return !isSeen(keypoint.point); });
    left += image.keypoints.size();
  }
  std::erase_if(model.points, [&](const ColmapModel::Point& point) { return !isSeen(point.id); });
  return before - left;
}

}  // namespace tessera
