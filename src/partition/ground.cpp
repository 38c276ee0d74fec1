#include "partition/ground.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/order_statistics.h"
#include "base/random.h"
#include "partition/cameras.h"

namespace tessera {
namespace {

constexpr size_t kMaxPoints = 20000;  // of the subsample; more do not improve the fit
constexpr uint64_t kTrials = 500;
constexpr double kMinShare = 0.1;        // minimum fraction of points on the plane
constexpr double kMaxTiltTried = 60;     // degrees; steeper than kMaxTilt, so that a best plane beyond that is rejected
constexpr double kTolerance = 0.005;     // half the thickness of the ground, as a fraction of the points' diagonal
constexpr double kFullLayer = 0.5;       // of the fullest layer's points
constexpr double kLookDown = 0.5;        // fraction of cameras that look down in a flight
constexpr double kNoHigherThan = 0.1;    // of the flight's width: the ground is farther below the cameras than this
constexpr double kGuessedShare = 0.5;    // of the flight's width
constexpr double kMinDiagonal = 1e-300;  // for points that all coincide

std::vector<Vec3d> subsamplePoints(const std::vector<SparsePoint>& points) {
  std::vector<Vec3d> chosen;
  const size_t count = std::min(points.size(), kMaxPoints);
  for (size_t i = 0; i < count; ++i) chosen.push_back(points[i * points.size() / count].xInWorld);
  return chosen;
}

// Returns the diagonal of the box between the 2nd and 98th percentiles along the three axes.
double robustDiagonal(const std::vector<Vec3d>& points) {
  Vec3d size;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3d& point : points) values.push_back(point[axis]);
    const double low = percentile(values, 0.02);
    size[axis] = percentile(values, 0.98) - low;
  }
  return size.norm();
}

struct Plane {
  Vec3d normal = Vec3d::Zero();  // unit, on the side of the world's z
  double offset = 0;             // normal · x
};

bool isTilted(const Vec3d& normal, double maximum) {
  return normal.z() < std::cos(maximum * std::numbers::pi / 180);
}

std::vector<const Vec3d*> near(const Plane& plane, const std::vector<Vec3d>& points, double tolerance) {
  std::vector<const Vec3d*> inliers;
  for (const Vec3d& point : points) {
    if (std::abs(plane.normal.dot(point) - plane.offset) <= tolerance) inliers.push_back(&point);
  }
  return inliers;
}

Plane leastSquares(const std::vector<const Vec3d*>& points) {
  Vec3d mean = Vec3d::Zero();
  for (const Vec3d* point : points) mean += *point / static_cast<double>(points.size());
  Mat3d covariance = Mat3d::Zero();
  for (const Vec3d* point : points) covariance += (*point - mean) * (*point - mean).transpose();
  Plane plane;
  plane.normal = Eigen::SelfAdjointEigenSolver<Mat3d>(covariance).eigenvectors().col(0);
  if (plane.normal.z() < 0) plane.normal = -plane.normal;
  plane.offset = plane.normal.dot(mean);
  return plane;
}

std::optional<Plane> fitPlane(const std::vector<Vec3d>& points, double tolerance, size_t& inlierCount) {
  const RandomStream random(4711, 0);
  Plane best;
  size_t maximum = 0;
  for (uint64_t trial = 0; trial < kTrials; ++trial) {
    const auto draw = [&](uint64_t k) -> const Vec3d& {
      return points[random.below(3 * trial + k, static_cast<uint32_t>(points.size()))];
    };
    const Vec3d a = draw(0), normal = (draw(1) - a).cross(draw(2) - a);
    const double length = normal.norm();
    if (!(length > 0)) continue;
    Plane plane;
    plane.normal = normal / (normal.z() < 0 ? -length : length);
    plane.offset = plane.normal.dot(a);
    if (isTilted(plane.normal, kMaxTiltTried)) continue;
    const size_t count = near(plane, points, tolerance).size();
    if (count > maximum) {
      maximum = count;
      best = plane;
    }
  }
  if (static_cast<double>(maximum) < kMinShare * static_cast<double>(points.size())) return std::nullopt;
  for (int round = 0; round < 3; ++round) best = leastSquares(near(best, points, tolerance));
  inlierCount = near(best, points, tolerance).size();
  return isTilted(best.normal, kMaxTilt) ? std::nullopt : std::optional(best);
}

Mat3d frameWithUp(const Vec3d& up) {
  Vec3d x = Vec3d::UnitX() - up * up.x();
  if (x.norm() < 1e-3) x = Vec3d::UnitY() - up * up.y();
  x.normalize();
  Mat3d frame;
  frame << x.transpose(), up.cross(x).transpose(), up.transpose();
  return frame;
}

// Finds the lowest window of `thickness` that contains at least kFullLayer times as many heights as the fullest one,
// moves it up while the count increases, and returns the median height in it.
double lowestFullLayer(std::vector<double> heights, double thickness) {
  std::sort(heights.begin(), heights.end());
  std::vector<size_t> counts(heights.size());  // in the window that starts at each height
  for (size_t begin = 0, end = 0; begin < heights.size(); ++begin) {
    while (end < heights.size() && heights[end] <= heights[begin] + thickness) ++end;
    counts[begin] = end - begin;
  }
  const size_t maximum = *std::max_element(counts.begin(), counts.end());
  size_t at = 0;
  while (static_cast<double>(counts[at]) < kFullLayer * static_cast<double>(maximum)) ++at;
  for (size_t next = at;; at = next) {
    for (size_t i = at; i < heights.size() && heights[i] <= heights[at] + thickness; ++i) {
      if (counts[i] > counts[next]) next = i;
    }
    if (next == at) break;
  }
  return heights[at + counts[at] / 2];
}

// Returns the height of the take-off along up, from the drones' heights above it, or nothing unless most photos have
// one and the capture has a geo reference.
std::optional<double> takeOffHeight(const Capture& capture, const std::vector<int>& photos, const Vec3d& up) {
  if (!capture.geo) return std::nullopt;
  const double metresPerUnit = std::cbrt(capture.geo->enuFromWorld.topLeftCorner<3, 3>().determinant());
  std::vector<double> heights;
  for (const int photo : photos) {
    const std::optional<GpsFix>& gps = capture.photos[photo].gps;
    if (!gps || gps->relativeAltitude == 0) continue;
    heights.push_back(up.dot(capture.photos[photo].worldFromCamera.translation) -
                      gps->relativeAltitude / metresPerUnit);
  }
  if (2 * heights.size() <= photos.size() || !(metresPerUnit > 0)) return std::nullopt;
  return percentile(heights, 0.5);
}

void heightFromCameras(const Capture& capture, Ground& ground) {
  const std::vector<int> photos = photosTogether(capture);
  const Vec3d up = ground.up();
  if (const auto height = takeOffHeight(capture, photos, up)) {
    ground.height = *height;
    ground.how += "height from the drone's height above take-off";
    return;
  }
  ground.height = up.dot(findFocusPoint(capture, photos));
  ground.how += "height where the cameras' axes come nearest to each other";
  if (photos.empty()) return;
  std::vector<double> heights, x, y;
  size_t lookingDown = 0;
  for (const int photo : photos) {
    const Pose& pose = capture.photos[photo].worldFromCamera;
    const Vec3d centre = ground.groundFromWorld * pose.translation;
    heights.push_back(centre.z());
    x.push_back(centre.x());
    y.push_back(centre.y());
    lookingDown += up.dot(pose.rotation.col(2)) < -0.5;
  }
  const double low = percentile(x, 0.02), near = percentile(y, 0.02);
  const double width = std::max(percentile(x, 0.98) - low, percentile(y, 0.98) - near);
  const double middle = percentile(heights, 0.5);
  const bool isFlight = static_cast<double>(lookingDown) > kLookDown * static_cast<double>(photos.size());
  if (isFlight && middle - ground.height <= kNoHigherThan * width) {
    ground.height = middle - (width > 0 ? kGuessedShare * width : 1);
    ground.how += ", which is at the cameras themselves: guessed from the width of the flight";
  }
}

}  // namespace

Ground findGround(const Capture& capture) {
  Ground ground;
  const std::vector<Vec3d> points = subsamplePoints(capture.points);
  const bool enough = points.size() >= kEnoughGroundPoints;
  const double tolerance = enough ? kTolerance * std::max(robustDiagonal(points), kMinDiagonal) : 0;
  size_t inliers = 0;
  if (capture.geo) {
    ground.groundFromWorld = frameWithUp(Vec3d(capture.geo->enuFromWorld.block<1, 3>(2, 0).transpose()).normalized());
    ground.how = "up from the geo reference; ";
  } else if (!enough) {
    ground.how = "up is the world's z; ";
  } else if (const auto plane = fitPlane(points, tolerance, inliers)) {
    ground.groundFromWorld = frameWithUp(plane->normal);
    ground.how = fmt::format("up from a plane through {} of {} points, tilted by {:.1f} degrees; ", inliers,
                             points.size(), std::acos(std::min(1.0, plane->normal.z())) * 180 / std::numbers::pi);
  } else {
    ground.how = "up is the world's z, as the points agree on no level plane; ";
  }
  if (!enough) {
    heightFromCameras(capture, ground);
    return ground;
  }
  std::vector<double> heights;
  for (const Vec3d& point : points) heights.push_back(ground.up().dot(point));
  ground.height = lowestFullLayer(std::move(heights), 2 * tolerance);
  ground.how += fmt::format("height from {} points", capture.points.size());
  return ground;
}

}  // namespace tessera
