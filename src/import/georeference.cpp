#include "import/georeference.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>

#include "base/check.h"
#include "base/order_statistics.h"
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

// Fixes of photos, and the errors of altitudes that their flights share.
struct Fixes {
  Points world, enu;                       // 3 × n; `enu` as measured
  std::vector<int> flight;                 // by fix
  std::vector<std::vector<int>> ofFlight;  // fixes by flight

  Points corrected(const std::vector<double>& tooHigh) const {
    Points places = enu;
    for (Eigen::Index i = 0; i < places.cols(); ++i)
      places(2, i) -= tooHigh[static_cast<size_t>(flight[static_cast<size_t>(i)])];
    return places;
  }
};

// A similarity, and for each flight how far its altitudes exceed those that the similarity gives.
struct Fit {
  Mat4d enuFromWorld = Mat4d::Identity();
  std::vector<double> tooHigh;
  std::vector<int> inliers;
};

constexpr size_t kLeastOfFlight = 3;  // fixes

// Finds the heights by which flights are too high, and the fixes that agree.
void judge(const Fixes& fixes, Fit& fit) {
  const Points mapped = (fit.enuFromWorld * fixes.world.colwise().homogeneous()).topRows<3>();
  const auto above = [&](int i) { return fixes.enu(2, i) - mapped(2, i); };
  fit.tooHigh.assign(fixes.ofFlight.size(), 0);
  const bool isOne = fixes.ofFlight.size() == 1;
  for (size_t f = 0; f < fixes.ofFlight.size() && !isOne; ++f) {
    if (fixes.ofFlight[f].size() < kLeastOfFlight) continue;
    std::vector<double> heights;
    for (const int i : fixes.ofFlight[f]) heights.push_back(above(i));
    fit.tooHigh[f] = upperMedian(heights);
  }
  const Points places = fixes.corrected(fit.tooHigh);
  fit.inliers.clear();
  for (Eigen::Index i = 0; i < places.cols(); ++i) {
    if ((mapped.col(i) - places.col(i)).norm() < kGpsTolerance) fit.inliers.push_back(static_cast<int>(i));
  }
}

// Fits the similarity to the fixes that agree, as long as they determine one.
void refine(const Fixes& fixes, Fit& fit) {
  const Points world = selectColumns(fixes.world, fit.inliers);
  if (fit.inliers.size() < 3 || isLine(world)) return;
  fit.enuFromWorld = Eigen::umeyama(world, selectColumns(fixes.corrected(fit.tooHigh), fit.inliers));
  judge(fixes, fit);
}

// Altitudes are relative to the median flight.
void shiftToMedianFlight(const Fixes& fixes, Fit& fit) {
  std::vector<double> known;
  for (size_t f = 0; f < fixes.ofFlight.size(); ++f)
    if (fixes.ofFlight[f].size() >= kLeastOfFlight) known.push_back(fit.tooHigh[f]);
  if (fixes.ofFlight.size() == 1 || known.empty()) return;
  std::sort(known.begin(), known.end());
  const double middle = 0.5 * (known[(known.size() - 1) / 2] + known[known.size() / 2]);
  fit.enuFromWorld(2, 3) += middle;
  judge(fixes, fit);
}

}  // namespace

Vec3d enuFromGps(const GeoFrame& frame, double latitude, double longitude, double altitude) {
  const GeographicLib::LocalCartesian local(frame.latitude, frame.longitude, frame.altitude);
  Vec3d enu;
  local.Forward(latitude, longitude, altitude, enu.x(), enu.y(), enu.z());
  return enu;
}

std::optional<Georeference> georeference(const std::vector<Photo>& photos, const std::vector<int>& flights,
                                         std::string& reason) {
  CHECK((flights.empty() || flights.size() == photos.size()));
  std::vector<const Photo*> fixed;
  Fixes fixes;
  bool allRelative = true;
  Georeference result;
  double meanRelative = 0;
  for (const Photo& photo : photos) {
    if (!photo.gps) continue;
    const auto flight = flights.empty() ? 0 : static_cast<size_t>(flights[static_cast<size_t>(&photo - photos.data())]);
    if (flight >= fixes.ofFlight.size()) fixes.ofFlight.resize(flight + 1);
    fixes.ofFlight[flight].push_back(static_cast<int>(fixed.size()));
    fixes.flight.push_back(static_cast<int>(flight));
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

  Points &world = fixes.world, &enu = fixes.enu;
  world.resize(3, n);
  enu.resize(3, n);
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

  Fit best;
  const RandomStream random(1991, 0);
  constexpr uint64_t kTrials = 1000;
  for (uint64_t trial = 0; trial < kTrials && static_cast<int>(best.inliers.size()) < n; ++trial) {
    std::vector<int> sample;
    // All of one flight, whose altitudes have the same error.
    const auto first = static_cast<size_t>(random.below(trial * 64, static_cast<uint32_t>(n)));
    const std::vector<int>& among = fixes.ofFlight[static_cast<size_t>(fixes.flight[first])];
    for (uint64_t k = 1; sample.size() < std::min<size_t>(3, among.size()) && k < 64; ++k) {
      const int candidate = among[random.below(trial * 64 + k, static_cast<uint32_t>(among.size()))];
      if (std::find(sample.begin(), sample.end(), candidate) == sample.end()) sample.push_back(candidate);
    }
    if (sample.size() < 3) continue;
    const Points from = selectColumns(world, sample), to = selectColumns(enu, sample);
    if (isLine(from) || isLine(to)) continue;
    Fit fit;
    fit.enuFromWorld = Eigen::umeyama(from, to);
    judge(fixes, fit);
    // Refine on all inliers: three noisy fixes of nearby photos alone constrain the rotation too weakly.
    for (int round = 0; round < 3; ++round) refine(fixes, fit);
    if (fit.inliers.size() > best.inliers.size()) best = std::move(fit);
  }
  if (best.inliers.size() < 3 || 2 * static_cast<int>(best.inliers.size()) < n ||
      isLine(selectColumns(world, best.inliers))) {
    reason = fmt::format("only {} of {} GPS fixes agree with the poses to within {} m", best.inliers.size(), n,
                         kGpsTolerance);
    return std::nullopt;
  }
  // Similarity and heights are fitted in turns.
  constexpr int kLastRounds = 20;
  for (int round = 0; round < kLastRounds; ++round) refine(fixes, best);
  shiftToMedianFlight(fixes, best);
  result.frame.enuFromWorld = best.enuFromWorld;
  result.heightsTooHigh = best.tooHigh;
  result.inliers = static_cast<int>(best.inliers.size());
  const Points from = selectColumns(world, best.inliers),
               to = selectColumns(fixes.corrected(best.tooHigh), best.inliers);
  const Points residual = (result.frame.enuFromWorld * from.colwise().homogeneous()).topRows<3>() - to;
  result.rmsMetres = residual.norm() / std::sqrt(static_cast<double>(best.inliers.size()));
  if (result.rmsMetres > spread / 3) {
    reason = fmt::format("the GPS fixes deviate from the poses by {:.1f} m, over a spread of {:.1f} m",
                         result.rmsMetres, spread);
    return std::nullopt;
  }
  return result;
}

}  // namespace tessera
