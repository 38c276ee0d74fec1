#include "import/georeference.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>

#include "base/random.h"

namespace tessera {
namespace {

using Points = Eigen::Matrix3Xd;

Points selectColumns(const Points& points, const std::vector<int>& which) {
  Points chosen(3, static_cast<Eigen::Index>(which.size()));
  for (size_t i = 0; i < which.size(); ++i) chosen.col(static_cast<Eigen::Index>(i)) = points.col(which[i]);
  return chosen;
}

// Returns the standard deviations along the two widest directions.
std::pair<double, double> principalDeviations(const Points& points) {
  const Points centred = points.colwise() - points.rowwise().mean();
  const Mat3d covariance = centred * centred.transpose() / static_cast<double>(points.cols());
  const Vec3d variances = Eigen::SelfAdjointEigenSolver<Mat3d>(covariance, Eigen::EigenvaluesOnly).eigenvalues();
  return {std::sqrt(std::max(variances[2], 0.0)), std::sqrt(std::max(variances[1], 0.0))};
}

bool isLine(const Points& points) {
  const auto [first, second] = principalDeviations(points);
  return !(first > 0) || !(second > 0.02 * first);
}

std::vector<int> agreeing(const Mat4d& enuFromWorld, const Points& world, const Points& enu) {
  std::vector<int> inliers;
  for (Eigen::Index i = 0; i < world.cols(); ++i) {
    const Vec3d mapped = (enuFromWorld * world.col(i).homogeneous()).head<3>();
    if ((mapped - enu.col(i)).norm() < kGpsTolerance) inliers.push_back(static_cast<int>(i));
  }
  return inliers;
}

}  // namespace

Vec3d enuFromGps(const GeoFrame& frame, double latitude, double longitude, double altitude) {
  const GeographicLib::LocalCartesian local(frame.latitude, frame.longitude, frame.altitude);
  Vec3d enu;
  local.Forward(latitude, longitude, altitude, enu.x(), enu.y(), enu.z());
  return enu;
}

std::optional<Georeference> georeference(const std::vector<Photo>& photos, std::string& reason) {
  std::vector<const Photo*> fixed;
  bool allRelative = true;
  Georeference result;
  double meanRelative = 0;
  for (const Photo& photo : photos) {
    if (!photo.gps) continue;
    fixed.push_back(&photo);
    allRelative = allRelative && photo.gps->relativeAltitude != 0;
    result.frame.latitude += photo.gps->latitude;
    result.frame.longitude += photo.gps->longitude;  // the fit below fails across the antimeridian
    result.frame.altitude += photo.gps->altitude;
    meanRelative += photo.gps->relativeAltitude;
  }
  const auto n = static_cast<int>(fixed.size());
  result.fixes = n;
  if (n < 3) {
    reason = fmt::format("{} photos with GPS; three are needed", n);
    return std::nullopt;
  }
  for (double* mean : {&result.frame.latitude, &result.frame.longitude, &result.frame.altitude, &meanRelative})
    *mean /= n;

  Points world(3, n), enu(3, n);
  for (int i = 0; i < n; ++i) {
    const GpsFix& gps = *fixed[static_cast<size_t>(i)]->gps;
    const double altitude = allRelative ? result.frame.altitude + gps.relativeAltitude - meanRelative : gps.altitude;
    enu.col(i) = enuFromGps(result.frame, gps.latitude, gps.longitude, altitude);
    world.col(i) = fixed[static_cast<size_t>(i)]->worldFromCamera.translation;
  }
  if (isLine(world) || isLine(enu)) {
    reason = "the photos with GPS stand on one line";
    return std::nullopt;
  }
  const double spread = principalDeviations(enu).second;
  if (spread < kMinGpsSpread) {
    reason = fmt::format("the photos lie within about {:.1f} m of one line, too near for the accuracy of GPS", spread);
    return std::nullopt;
  }

  std::vector<int> best;
  const RandomStream random(1991, 0);
  constexpr uint64_t kTrials = 1000;
  for (uint64_t trial = 0; trial < kTrials && static_cast<int>(best.size()) < n; ++trial) {
    std::vector<int> sample;
    for (uint64_t k = 0; sample.size() < 3; ++k) {
      const auto candidate = static_cast<int>(random.below(trial * 64 + k, static_cast<uint32_t>(n)));
      if (std::find(sample.begin(), sample.end(), candidate) == sample.end()) sample.push_back(candidate);
    }
    const Points from = selectColumns(world, sample), to = selectColumns(enu, sample);
    if (isLine(from) || isLine(to)) continue;
    std::vector<int> inliers = agreeing(Eigen::umeyama(from, to), world, enu);
    // Refine on all inliers: three noisy fixes of nearby photos alone constrain the rotation too weakly.
    for (int round = 0; round < 3 && inliers.size() >= 3 && !isLine(selectColumns(world, inliers)); ++round) {
      inliers = agreeing(Eigen::umeyama(selectColumns(world, inliers), selectColumns(enu, inliers)), world, enu);
    }
    if (inliers.size() > best.size()) best = std::move(inliers);
  }
  if (best.size() < 3 || 2 * static_cast<int>(best.size()) < n || isLine(selectColumns(world, best))) {
    reason = fmt::format("only {} of {} GPS fixes agree with the poses to within {} m", best.size(), n, kGpsTolerance);
    return std::nullopt;
  }
  const Points from = selectColumns(world, best), to = selectColumns(enu, best);
  result.frame.enuFromWorld = Eigen::umeyama(from, to);
  result.inliers = static_cast<int>(best.size());
  const Points residual = (result.frame.enuFromWorld * from.colwise().homogeneous()).topRows<3>() - to;
  result.rmsMetres = residual.norm() / std::sqrt(static_cast<double>(best.size()));
  if (result.rmsMetres > spread / 3) {
    reason = fmt::format("the GPS fixes deviate from the poses by {:.1f} m, over a spread of {:.1f} m",
                         result.rmsMetres, spread);
    return std::nullopt;
  }
  return result;
}

}  // namespace tessera
