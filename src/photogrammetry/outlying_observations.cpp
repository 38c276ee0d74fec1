#include "photogrammetry/outlying_observations.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "base/order_statistics.h"

namespace tessera {
namespace {

constexpr double kMedians = 3;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr size_t kLeastViews = 2;        // of a point
constexpr size_t kFewObservations = 30;  // of a photo, with which the mapper places it at least

// How many photos show a point, a photo counting once.
struct Views {
  size_t count = 0, last = std::numeric_limits<size_t>::max();

  void add(size_t image) {
    if (image != last) ++count;
    last = image;
  }
};

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
  std::vector<double> limits(model.images.size(), kInfinity);
  for (size_t i = 0; i < model.images.size(); ++i) {
    if (errors[i].size() < kFewObservations) continue;
    std::vector<double> own = errors[i];
    limits[i] = kMedians * std::max(median, upperMedian(own));
  }
  std::unordered_set<uint64_t> needed;  // points that photos with few others keep, in all their photos
  const auto agrees = [&](size_t image, size_t keypoint) {
    const double error = errors[image].empty() ? 0 : errors[image][keypoint];
    return error < kInfinity &&
           (error <= limits[image] || needed.contains(model.images[image].keypoints[keypoint].point));
  };
  std::unordered_map<uint64_t, Views> views;
  const auto countViews = [&] {
    views.clear();
    for (size_t i = 0; i < model.images.size(); ++i)
      for (size_t k = 0; k < model.images[i].keypoints.size(); ++k)
        if (agrees(i, k)) views[model.images[i].keypoints[k].point].add(i);
  };
  const auto isSeen = [&](uint64_t point) {
    const auto count = views.find(point);
    return count != views.end() && count->second.count >= kLeastViews;
  };
  countViews();
  // The other photos of a blurred one, which are more exact, may not agree with most of its points.
  for (size_t i = 0; i < model.images.size(); ++i) {
    const std::vector<ColmapModel::Keypoint>& keypoints = model.images[i].keypoints;
    size_t left = 0;
    for (size_t k = 0; k < keypoints.size(); ++k) left += agrees(i, k) && isSeen(keypoints[k].point) ? 1 : 0;
    if (left >= kFewObservations && 2 * left >= keypoints.size()) continue;
    for (const ColmapModel::Keypoint& keypoint : keypoints) needed.insert(keypoint.point);
  }
  countViews();
  size_t removed = 0;
  for (size_t i = 0; i < model.images.size(); ++i) {
    std::vector<ColmapModel::Keypoint>& keypoints = model.images[i].keypoints;
    std::vector<ColmapModel::Keypoint> agreeing;
    for (size_t k = 0; k < keypoints.size(); ++k)
      if (agrees(i, k) && isSeen(keypoints[k].point)) agreeing.push_back(keypoints[k]);
    removed += keypoints.size() - agreeing.size();
    keypoints = std::move(agreeing);
  }
  std::erase_if(model.points, [&](const ColmapModel::Point& point) { return !isSeen(point.id); });
  return removed;
}

}  // namespace tessera
