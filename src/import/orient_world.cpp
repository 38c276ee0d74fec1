#include "import/orient_world.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/log.h"
#include "base/order_statistics.h"
#include "import/georeference.h"

namespace tessera {
namespace {

double similarityScale(const Mat4d& similarity) {
  return std::cbrt(similarity.topLeftCorner<3, 3>().determinant());
}

Vec3d medianCentre(const std::vector<Photo>& photos) {
  Vec3d median = Vec3d::Zero();
  if (photos.empty()) return median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Photo& photo : photos) values.push_back(photo.worldFromCamera.translation[axis]);
    median[axis] = upperMedian(values);
  }
  return median;
}

// Returns the up direction in camera axes for a camera at those angles: pitch 0 is level, -90 looks down; roll rotates
// the camera about its optical axis, clockwise as seen from behind.
Vec3d upInCamera(const GimbalAngles& gimbal) {
  const double pitch = gimbal.pitch * M_PI / 180, roll = gimbal.roll * M_PI / 180;
  const Vec3d level(0, -std::cos(pitch), std::sin(pitch));
  return Eigen::AngleAxisd(-roll, Vec3d::UnitZ()) * level;
}

// The direction in which the photos differ least.
Vec3d planeNormal(const std::vector<Photo>& photos) {
  Vec3d middle = Vec3d::Zero();
  for (const Photo& photo : photos) middle += photo.worldFromCamera.translation / static_cast<double>(photos.size());
  Mat3d covariance = Mat3d::Zero();
  for (const Photo& photo : photos) {
    const Vec3d offset = photo.worldFromCamera.translation - middle;
    covariance += offset * offset.transpose();
  }
  return Eigen::SelfAdjointEigenSolver<Mat3d>(covariance).eigenvectors().col(0);
}

struct Up {
  Vec3d direction;
  std::string how;
};

// Returns where up is, in camera axes (x right, y down), in a picture that viewers turn so.
Vec3d upInPicture(int orientation) {
  switch (orientation) {
    case 3:
    case 4:
      return Vec3d::UnitY();
    case 5:
    case 6:
      return -Vec3d::UnitX();
    case 7:
    case 8:
      return Vec3d::UnitX();
    default:
      return -Vec3d::UnitY();
  }
}

Up findUp(const std::vector<Photo>& photos, const std::vector<UprightTags>& tags) {
  Vec3d gimbalUp = Vec3d::Zero(), cameraUp = Vec3d::Zero(), forward = Vec3d::Zero();
  int withGimbal = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    const Mat3d& rotation = photos[i].worldFromCamera.rotation;
    cameraUp += rotation * upInPicture(i < tags.size() ? tags[i].orientation : 1);
    forward += rotation.col(2);
    if (i < tags.size() && tags[i].gimbal) {
      gimbalUp += rotation * upInCamera(*tags[i].gimbal);
      ++withGimbal;
    }
  }
  const double n = static_cast<double>(photos.size());
  if (2 * withGimbal >= static_cast<int>(photos.size()) && gimbalUp.norm() > 0.8 * withGimbal) {
    return {gimbalUp.normalized(), "up from the gimbal's angles"};
  }
  if (cameraUp.norm() > 0.7 * n || photos.size() < 3) {
    if (!(cameraUp.norm() > 1e-3)) return {Vec3d::UnitZ(), "the cameras share no up direction; the source's Z is kept"};
    return {cameraUp.normalized(), "up from the mean of the cameras' up"};
  }
  Vec3d normal = planeNormal(photos);
  const bool looksAlong = std::abs(forward.normalized().dot(normal)) > 0.7 && forward.norm() > 0.7 * n;
  if (!looksAlong && cameraUp.norm() > 0.2 * n) return {cameraUp.normalized(), "up from the mean of the cameras' up"};
  // Where the cameras look away from their plane, up is the opposite side; where they look around within it, the mean
  // of the cameras' up selects the side.
  const double side = looksAlong ? -forward.dot(normal) : cameraUp.dot(normal);
  if (side < 0) normal = -normal;
  return {normal, "up from the plane of the cameras"};
}

// A flight whose altitudes are wrong is named by its first photo.
void warnOfHeights(const SourceCapture& source, const Georeference& fit) {
  if (!fit.hasAltitudes)
    warn("GPS states no altitudes: the cameras are taken to be at height 0 of the Earth, on average");
  if (fit.ignoresTakeOff)
    warn("absolute altitudes are used: those above take-off do not fit the poses (did flights start elsewhere?)");
  for (size_t flight = 0; flight < fit.heightsTooHigh.size(); ++flight) {
    const double metres = fit.heightsTooHigh[flight];
    if (metres == 0) continue;
    const auto first = std::find(source.flight.begin(), source.flight.end(), static_cast<int>(flight));
    warn("the altitudes of the flight that begins with {} are {:.1f} m {} for those of the others; corrected",
         source.capture.photos[static_cast<size_t>(first - source.flight.begin())].name, std::abs(metres),
         metres > 0 ? "too high" : "too low");
  }
}

Mat4d translation(const Vec3d& t) {
  Mat4d matrix = Mat4d::Identity();
  matrix.topRightCorner<3, 1>() = t;
  return matrix;
}

}  // namespace

double applySimilarity(Capture& capture, const Mat4d& newFromOld) {
  const double scale = similarityScale(newFromOld);
  const Mat3d rotation = newFromOld.topLeftCorner<3, 3>() / scale;
  const auto move = [&newFromOld](const Vec3d& x) -> Vec3d { return (newFromOld * x.homogeneous()).head<3>(); };
  for (Photo& photo : capture.photos) {
    photo.worldFromCamera.rotation = rotation * photo.worldFromCamera.rotation;
    photo.worldFromCamera.translation = move(photo.worldFromCamera.translation);
    photo.depthUnit *= static_cast<float>(scale);
  }
  for (SparsePoint& point : capture.points) point.xInWorld = move(point.xInWorld);
  const Mat4d oldFromNew = affineInverse(newFromOld);
  capture.sourceFromWorld *= oldFromNew;
  if (capture.geo) capture.geo->enuFromWorld *= oldFromNew;
  return scale;
}

Orientation orientWorld(SourceCapture& source, const std::vector<UprightTags>& tags) {
  Capture& capture = source.capture;
  if (source.isOurs || capture.photos.empty()) return {"a capture of our own: its world is kept", 1};
  Orientation orientation;
  std::string why;
  if (const auto fit = georeference(capture.photos, source.flight, why)) {
    capture.geo = fit->frame;
    orientation.scale = applySimilarity(capture, fit->frame.enuFromWorld);
    orientation.how = fmt::format("east, north, up in metres from {} of {} GPS fixes, with residuals of {:.2f} m",
                                  fit->inliers, fit->fixes, fit->rmsMetres);
    warnOfHeights(source, *fit);
  } else {
    const bool hasGps =
        std::any_of(capture.photos.begin(), capture.photos.end(), [](const Photo& p) { return !!p.gps; });
    if (hasGps) warn("no geo reference: {}", why);
    if (source.knowsUp) {
      orientation.how = "the source's Z is up";
    } else {
      const Up up = findUp(capture.photos, tags);
      Mat4d turn = Mat4d::Identity();
      turn.topLeftCorner<3, 3>() = Eigen::Quaterniond::FromTwoVectors(up.direction, Vec3d::UnitZ()).toRotationMatrix();
      applySimilarity(capture, turn);
      orientation.how = up.how;
    }
  }
  applySimilarity(capture, translation(-medianCentre(capture.photos)));
  return orientation;
}

}  // namespace tessera
