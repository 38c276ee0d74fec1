#include "photogrammetry/camera_motion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace tessera {
namespace {

constexpr size_t kLeastShared = 20, kMaxShared = 200;  // points of a pair of photos
constexpr size_t kFirstPhotos = 12, kPairs = 40;

// Where two photos show the points that they share, relative to their middles, in units of their longer sides.
struct SharedPoints {
  std::vector<Eigen::Vector2d> first, second;
};

struct Sighting {
  uint64_t point;
  Eigen::Vector2d at;
};

// Returns the sightings of a photo, by point.
std::vector<Sighting> findSightings(const ColmapModel& model, const ColmapModel::Image& image) {
  std::vector<Sighting> sightings;
  const auto camera = model.cameras.find(image.camera);
  if (camera == model.cameras.end()) return sightings;
  const double width = camera->second.width, height = camera->second.height, longer = std::max(width, height);
  for (const ColmapModel::Keypoint& keypoint : image.keypoints)
    sightings.push_back({keypoint.point, {(keypoint.x - width / 2) / longer, (keypoint.y - height / 2) / longer}});
  std::sort(sightings.begin(), sightings.end(), [](const auto& a, const auto& b) { return a.point < b.point; });
  return sightings;
}

SharedPoints findShared(const std::vector<Sighting>& first, const std::vector<Sighting>& second) {
  SharedPoints shared;
  for (auto a = first.begin(), b = second.begin(); a != first.end() && b != second.end();) {
    if (a->point < b->point) {
      ++a;
    } else if (b->point < a->point) {
      ++b;
    } else {
      shared.first.push_back((a++)->at);
      shared.second.push_back((b++)->at);
    }
  }
  return shared;
}

// Returns the pairs that share the fewest points: between them, the camera has moved most.
std::vector<SharedPoints> findDistantPairs(const ColmapModel& model) {
  std::vector<std::vector<Sighting>> photos;
  for (const ColmapModel::Image& image : model.images) photos.push_back(findSightings(model, image));
  std::vector<SharedPoints> pairs;
  const size_t step = std::max<size_t>(1, photos.size() / kFirstPhotos);
  for (size_t i = 0; i < photos.size(); i += step) {
    for (size_t j = 0; j < photos.size(); ++j) {
      if (j == i) continue;
      SharedPoints shared = findShared(photos[i], photos[j]);
      if (shared.first.size() >= kLeastShared) pairs.push_back(std::move(shared));
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const auto& a, const auto& b) { return a.first.size() < b.first.size(); });
  if (pairs.size() > kPairs) pairs.resize(kPairs);
  return pairs;
}

// Returns the median distance between where the second photo shows points and where the best turn of the first expects
// them. `focalLength`: in units of the longer side.
double turnResidual(const SharedPoints& pair, double focalLength) {
  const size_t step = (pair.first.size() + kMaxShared - 1) / kMaxShared;
  std::vector<Eigen::Vector3d> from, to;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < pair.first.size(); i += step) {
    const auto direction = [focalLength](const Eigen::Vector2d& at) {
      return Eigen::Vector3d(at.x(), at.y(), focalLength).normalized();
    };
    from.push_back(direction(pair.first[i]));
    to.push_back(direction(pair.second[i]));
    covariance += to.back() * from.back().transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  const Eigen::Matrix3d turn = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  std::vector<double> residuals;
  for (size_t i = 0; i < from.size(); ++i) residuals.push_back(focalLength * (turn * from[i] - to[i]).norm());
  std::nth_element(residuals.begin(), residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2),
                   residuals.end());
  return residuals[residuals.size() / 2];
}

}  // namespace

bool onlyTurns(const ColmapModel& model) {
  // A plane that a camera passes leaves 0.0014 and more, ground that is not quite flat 0.005, and one stop 0.0005.
  constexpr double kExplained = 0.001;
  constexpr double kShortest = 0.4, kLongest = 3;  // focal lengths, of the longer side
  constexpr int kFocalLengths = 33;
  const std::vector<SharedPoints> pairs = findDistantPairs(model);
  if (pairs.empty()) return false;
  for (int i = 0; i < kFocalLengths; ++i) {
    const double focalLength = kShortest * std::pow(kLongest / kShortest, static_cast<double>(i) / (kFocalLengths - 1));
    if (std::all_of(pairs.begin(), pairs.end(),
                    [&](const SharedPoints& pair) { return turnResidual(pair, focalLength) < kExplained; }))
      return true;
  }
  return false;
}

}  // namespace tessera
