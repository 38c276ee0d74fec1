#include "import/georeference.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <numbers>

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

constexpr size_t kLeastOfFlight = 3;     // fixes
constexpr double kLeastHeightError = 3;  // metres; less is usual for GPS

// Finds the fixes that agree.
void judge(const Fixes& fixes, Fit& fit) {
  const Points mapped = (fit.enuFromWorld * fixes.world.colwise().homogeneous()).topRows<3>();
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

// Returns for each flight the median height of its fixes above those of the similarity; nothing for flights of few
// fixes.
std::vector<std::optional<double>> heightsAbove(const Fixes& fixes, const Fit& fit) {
  const Points mapped = (fit.enuFromWorld * fixes.world.colwise().homogeneous()).topRows<3>();
  std::vector<std::optional<double>> heights(fixes.ofFlight.size());
  for (size_t f = 0; f < heights.size(); ++f) {
    if (fixes.ofFlight[f].size() < kLeastOfFlight) continue;
    std::vector<double> ofFlight;
    for (const int i : fixes.ofFlight[f]) ofFlight.push_back(fixes.enu(2, i) - mapped(2, i));
    heights[f] = upperMedian(ofFlight);
  }
  return heights;
}

// What a step of Gauss and Newton has found.
struct Step {
  // Of rotation (3) and scale about the middle of the fixes, translation (3) and heights, for the given deviations.
  Eigen::MatrixXd covariance;
};

// A step of Gauss and Newton on the similarity and the heights of the flights `corrected` together: in turns, they
// would converge slowly where flights lie side by side. `deviations`: of the coordinates of fixes, metres.
Step improve(const Fixes& fixes, const std::vector<size_t>& corrected, const Vec3d& deviations, Fit& fit) {
  Step step;
  if (fit.inliers.size() < 3) return step;
  const Points mapped =
      (fit.enuFromWorld * selectColumns(fixes.world, fit.inliers).colwise().homogeneous()).topRows<3>();
  const Vec3d middle = mapped.rowwise().mean();
  const Mat3d weights = deviations.cwiseAbs2().cwiseInverse().asDiagonal();
  const auto unknowns = static_cast<Eigen::Index>(7 + corrected.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
  for (Eigen::Index k = 0; k < mapped.cols(); ++k) {
    const auto fix = static_cast<size_t>(fit.inliers[static_cast<size_t>(k)]);
    const Vec3d q = mapped.col(k) - middle;
    Eigen::MatrixXd row = Eigen::MatrixXd::Zero(3, unknowns);
    row.leftCols<3>() << 0, q.z(), -q.y(), -q.z(), 0, q.x(), q.y(), -q.x(), 0;
    row.col(3) = q;
    row.middleCols<3>(4) = Mat3d::Identity();
    const auto of = std::find(corrected.begin(), corrected.end(), static_cast<size_t>(fixes.flight[fix]));
    if (of != corrected.end()) row(2, 7 + (of - corrected.begin())) = 1;
    normal += row.transpose() * weights * row;
    right += row.transpose() * weights * (fixes.enu.col(static_cast<Eigen::Index>(fix)) - mapped.col(k));
  }
  const auto solver = normal.completeOrthogonalDecomposition();
  const Eigen::VectorXd change = solver.solve(right);
  const Vec3d rotation = change.head<3>();
  Mat4d moved = Mat4d::Identity();
  const Mat3d turn = rotation.norm() > 0 ? Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix()
                                         : Mat3d::Identity();
  moved.topLeftCorner<3, 3>() = std::exp(change[3]) * turn;
  moved.topRightCorner<3, 1>() = middle + change.segment<3>(4) - moved.topLeftCorner<3, 3>() * middle;
  fit.enuFromWorld = moved * fit.enuFromWorld;
  for (size_t f = 0; f < corrected.size(); ++f) fit.tooHigh[corrected[f]] = change[static_cast<Eigen::Index>(7 + f)];
  step.covariance = solver.pseudoInverse();
  return step;
}

// Corrects flights whose altitudes clearly differ from those of the median flight; of two in the middle, from those of
// the one with more fixes. Only these are corrected: heights that were free for every flight would let the world tilt.
void correctFlights(const Fixes& fixes, Fit& fit) {
  const std::vector<std::optional<double>> heights = heightsAbove(fixes, fit);
  std::vector<std::pair<double, size_t>> order;  // height, number of fixes
  for (size_t f = 0; f < heights.size(); ++f) {
    if (!heights[f]) continue;
    order.emplace_back(*heights[f], fixes.ofFlight[f].size());
  }
  if (order.size() < 2) return;
  std::sort(order.begin(), order.end());
  const auto &lower = order[(order.size() - 1) / 2], &upper = order[order.size() / 2];
  const double standard = lower.second >= upper.second ? lower.first : upper.first;
  std::vector<size_t> corrected;
  for (size_t f = 0; f < heights.size(); ++f)
    if (heights[f] && std::abs(*heights[f] - standard) > kLeastHeightError) corrected.push_back(f);
  if (corrected.empty()) return;
  fit.enuFromWorld(2, 3) += standard;
  for (const size_t f : corrected) fit.tooHigh[f] = *heights[f] - standard;
  while (true) {
    constexpr int kRounds = 8;
    for (int round = 0; round < kRounds; ++round) {
      judge(fixes, fit);
      improve(fixes, corrected, Vec3d::Ones(), fit);
    }
    // The first fit may have followed a flight that is wrong, and made others seem to be.
    const size_t before = corrected.size();
    for (const size_t f : corrected)
      if (std::abs(fit.tooHigh[f]) <= kLeastHeightError) fit.tooHigh[f] = 0;
    std::erase_if(corrected, [&](size_t f) { return fit.tooHigh[f] == 0; });
    if (corrected.size() == before) break;
  }
  judge(fixes, fit);
}

// Moves fixes and fit up together.
void raise(Fixes& fixes, Fit& fit, double metres) {
  fixes.enu.row(2).array() += metres;
  fit.enuFromWorld(2, 3) += metres;
}

struct Rise {
  double metres = 0, error = 0;
};

// Returns the height of absolute altitudes above the fit with its standard error, the median of photos of flights that
// were not corrected. Flights that took off elsewhere have other heights above take-off, whose mean says little.
Rise medianRise(const GeoFrame& frame, const std::vector<const Photo*>& photos, const Fixes& fixes, const Fit& fit) {
  const Points mapped = (fit.enuFromWorld * fixes.world.colwise().homogeneous()).topRows<3>();
  std::vector<double> rises;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (fit.tooHigh[static_cast<size_t>(fixes.flight[i])] != 0) continue;
    const GpsFix& gps = *photos[i]->gps;
    if (!gps.hasAltitude) continue;
    rises.push_back(enuFromGps(frame, gps.latitude, gps.longitude, gps.altitude).z() -
                    mapped(2, static_cast<Eigen::Index>(i)));
  }
  if (rises.empty()) return {};
  constexpr double kMedian = 0.6745, kOfMedian = 1.2533;  // of a normal variable; of the error of the mean
  Rise rise{upperMedian(rises), 0};
  const auto n = static_cast<double>(rises.size());
  for (double& height : rises) height = std::abs(height - rise.metres);
  rise.error = kOfMedian * upperMedian(rises) / kMedian / std::sqrt(n);
  return rise;
}

// Returns what fixes differ from the fit by, for all of them.
Points differences(const Fixes& fixes, const Fit& fit) {
  return fixes.corrected(fit.tooHigh) - (fit.enuFromWorld * fixes.world.colwise().homogeneous()).topRows<3>();
}

// Returns the standard deviations of the coordinates of a fix. Medians: the tolerance of inliers is wide.
Vec3d estimateDeviations(const Points& residuals, const std::vector<int>& inliers, size_t unknowns) {
  constexpr size_t kFew = 12;
  constexpr double kLeast = 0.05;                            // metres
  constexpr double kMedianOfTwo = 1.1774, kMedian = 0.6745;  // of the length of two, and of one normal variable
  const auto n = static_cast<double>(inliers.size());
  const double free = 3 * n - static_cast<double>(unknowns);
  const double factor = free > 0 ? std::sqrt(3 * n / free) : 1;
  if (inliers.size() < kFew) {
    const double rms = selectColumns(residuals, inliers).norm() / std::sqrt(3 * n);
    return Vec3d::Constant(std::max(kLeast, factor * rms));
  }
  std::vector<double> across, up;
  for (const int i : inliers) {
    across.push_back(residuals.col(i).head<2>().norm());
    up.push_back(std::abs(residuals(2, i)));
  }
  const double horizontal = std::max(kLeast, factor * upperMedian(across) / kMedianOfTwo);
  return {horizontal, horizontal, std::max(kLeast, factor * upperMedian(up) / kMedian)};
}

// Fits the heights that the fixes exceed the poses by with a plane and the square of the distance from the middle.
std::optional<Georeference::Bend> findBend(const Points& places, const Points& residuals) {
  constexpr Eigen::Index kUnknowns = 4, kLeast = 12;
  const Eigen::Index n = places.cols();
  if (n < kLeast) return std::nullopt;
  const Vec3d middle = places.rowwise().mean();
  const Points centred = places.colwise() - middle;
  const double farthest = centred.topRows<2>().colwise().norm().maxCoeff();
  Eigen::Matrix<double, Eigen::Dynamic, kUnknowns> basis(n, kUnknowns);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vec2d at = centred.col(i).head<2>() / farthest;
    basis.row(i) << 1, at.x(), at.y(), at.squaredNorm();
  }
  const Mat4d normal = basis.transpose() * basis;
  const auto solver = normal.completeOrthogonalDecomposition();
  if (solver.rank() < kUnknowns) return std::nullopt;
  const Eigen::VectorXd heights = residuals.row(2).transpose();
  const Eigen::Vector4d solution = solver.solve(basis.transpose() * heights);
  const double variance = (heights - basis * solution).squaredNorm() / static_cast<double>(n - kUnknowns);
  return Georeference::Bend{solution[3], std::sqrt(variance * solver.pseudoInverse()(3, 3))};
}

// Improves the fit with fixes weighted by their deviations, and states how well it is determined.
void finish(const Fixes& fixes, Fit& fit, Georeference& result) {
  std::vector<size_t> corrected;
  for (size_t f = 0; f < fit.tooHigh.size(); ++f)
    if (fit.tooHigh[f] != 0) corrected.push_back(f);
  const size_t unknowns = 7 + corrected.size();
  Vec3d deviations = Vec3d::Ones();
  Step step;
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    deviations = estimateDeviations(differences(fixes, fit), fit.inliers, unknowns);
    step = improve(fixes, corrected, deviations, fit);
    judge(fixes, fit);
  }
  if (step.covariance.size() == 0) return;
  result.horizontalDeviation = deviations.x();
  result.verticalDeviation = deviations.z();
  const auto& c = step.covariance;
  result.scaleError = std::sqrt(c(3, 3));
  result.rotationError = std::sqrt(c.topLeftCorner<3, 3>().trace()) * 180 / std::numbers::pi;
  result.middleError = std::sqrt(c.block<3, 3>(4, 4).trace());
  const Points residuals = differences(fixes, fit);
  result.bend = findBend(selectColumns(fixes.enu, fit.inliers), selectColumns(residuals, fit.inliers));
  for (Eigen::Index i = 0; i < residuals.cols(); ++i) {
    const bool isInlier = std::binary_search(fit.inliers.begin(), fit.inliers.end(), static_cast<int>(i));
    result.residuals.push_back({static_cast<int>(i), residuals.col(i), deviations, isInlier});
  }
}

// What the altitudes of fixes are.
enum class Heights { aboveTakeOff, absolute, unknown };

struct Fitted {
  std::optional<Georeference> result;
  std::string reason;      // if there is none
  double heightError = 0;  // metres: mean of all fixes, each at most kGpsTolerance
};

// Returns why these places do not determine a rotation; nothing if they do.
std::string whyUndetermined(const Points& world, const Points& enu) {
  if (isLine(world) || isLine(enu)) return "the photos with GPS stand on one line";
  const double spread = principalDeviations(enu).second;
  if (spread >= kMinGpsSpread) return "";
  return fmt::format("the photos lie within about {:.1f} m of one line, too near for the accuracy of GPS", spread);
}

// Finds the similarity that most fixes agree with.
Fit fitMost(const Fixes& fixes) {
  Fit best;
  const auto n = static_cast<int>(fixes.world.cols());
  const RandomStream random(1991, 0);
  constexpr uint64_t kTrials = 1000;
  for (uint64_t trial = 0; trial < kTrials && static_cast<int>(best.inliers.size()) < n; ++trial) {
    std::vector<int> sample;
    for (uint64_t k = 0; sample.size() < 3; ++k) {
      const auto candidate = static_cast<int>(random.below(trial * 64 + k, static_cast<uint32_t>(n)));
      if (std::find(sample.begin(), sample.end(), candidate) == sample.end()) sample.push_back(candidate);
    }
    const Points from = selectColumns(fixes.world, sample), to = selectColumns(fixes.enu, sample);
    if (isLine(from) || isLine(to)) continue;
    Fit fit;
    fit.enuFromWorld = Eigen::umeyama(from, to);
    fit.tooHigh.assign(fixes.ofFlight.size(), 0);
    judge(fixes, fit);
    // Refine on all inliers: three noisy fixes of nearby photos alone constrain the rotation too weakly.
    for (int round = 0; round < 3; ++round) refine(fixes, fit);
    if (fit.inliers.size() > best.inliers.size()) best = std::move(fit);
  }
  return best;
}

// Fits the similarity with the heights of this kind.
Fitted fitTo(const std::vector<Photo>& photos, const std::vector<int>& flights, Heights heights, bool hasAltitudes) {
  std::vector<const Photo*> fixed;
  std::vector<GpsFix> gps;
  Fixes fixes;
  double meanRelative = 0, altitudes = 0;
  int known = 0;
  for (const Photo& photo : photos) {
    if (!photo.gps || (heights == Heights::absolute && !photo.gps->hasAltitude)) continue;
    if (heights == Heights::aboveTakeOff && photo.gps->relativeAltitude == 0) continue;
    const auto flight = flights.empty() ? 0 : static_cast<size_t>(flights[static_cast<size_t>(&photo - photos.data())]);
    if (flight >= fixes.ofFlight.size()) fixes.ofFlight.resize(flight + 1);
    fixes.ofFlight[flight].push_back(static_cast<int>(fixed.size()));
    fixes.flight.push_back(static_cast<int>(flight));
    fixed.push_back(&photo);
    gps.push_back(*photo.gps);
    known += photo.gps->hasAltitude ? 1 : 0;
    if (photo.gps->hasAltitude) altitudes += photo.gps->altitude;
    meanRelative += photo.gps->relativeAltitude;
  }
  const auto n = static_cast<int>(fixed.size());
  if (n < 3) return {{}, fmt::format("{} photos with GPS; three are needed", n)};
  meanRelative /= n;
  Georeference result;
  result.hasAltitudes = hasAltitudes;
  result.fixes = n;
  result.frame = frameAround(gps);
  if (hasAltitudes) result.frame.altitude = altitudes / known;

  Points &world = fixes.world, &enu = fixes.enu;
  world.resize(3, n);
  enu.resize(3, n);
  for (int i = 0; i < n; ++i) {
    const GpsFix& fix = gps[static_cast<size_t>(i)];
    const double altitude = heights == Heights::aboveTakeOff
                                ? result.frame.altitude + fix.relativeAltitude - meanRelative
                            : heights == Heights::absolute ? fix.altitude
                                                           : 0;
    enu.col(i) = enuFromGps(result.frame, fix.latitude, fix.longitude, altitude);
    world.col(i) = fixed[static_cast<size_t>(i)]->worldFromCamera.translation;
  }
  if (std::string reason = whyUndetermined(world, enu); !reason.empty()) return {{}, std::move(reason)};

  Fit best = fitMost(fixes);
  if (best.inliers.size() >= 3) {
    correctFlights(fixes, best);
    const Rise rise =
        heights == Heights::aboveTakeOff && hasAltitudes ? medianRise(result.frame, fixed, fixes, best) : Rise{};
    raise(fixes, best, rise.metres);
    finish(fixes, best, result);
    result.middleError = std::hypot(result.middleError, rise.error);
    for (Georeference::Residual& residual : result.residuals)
      residual.photo = static_cast<int>(fixed[static_cast<size_t>(residual.photo)] - photos.data());
  }
  if (best.inliers.size() < 3 || 2 * static_cast<int>(best.inliers.size()) < n)
    return {{},
            fmt::format("only {} of {} GPS fixes agree with the poses to within {} m", best.inliers.size(), n,
                        kGpsTolerance)};
  // A wild fix can make photos on a line seem to be spread.
  const Points agreeing = selectColumns(enu, best.inliers);
  if (std::string reason = whyUndetermined(selectColumns(world, best.inliers), agreeing); !reason.empty())
    return {{}, std::move(reason)};
  result.frame.enuFromWorld = best.enuFromWorld;
  result.heightsTooHigh = best.tooHigh;
  result.inliers = static_cast<int>(best.inliers.size());
  const Points all = differences(fixes, best);
  result.rmsMetres = selectColumns(all, best.inliers).norm() / std::sqrt(static_cast<double>(best.inliers.size()));
  const double spread = principalDeviations(agreeing).second;
  if (result.rmsMetres > spread / 3)
    return {{},
            fmt::format("the GPS fixes deviate from the poses by {:.1f} m, over a spread of {:.1f} m", result.rmsMetres,
                        spread)};
  return {std::move(result), "", all.row(2).cwiseAbs().cwiseMin(kGpsTolerance).mean()};
}

}  // namespace

bool Georeference::isBent() const {
  constexpr double kErrors = 4, kLeastMetres = 0.5;
  return bend && std::abs(bend->metres) > std::max(kErrors * bend->error, kLeastMetres);
}

Vec3d enuFromGps(const GeoFrame& frame, double latitude, double longitude, double altitude) {
  const GeographicLib::LocalCartesian local(frame.latitude, frame.longitude, frame.altitude);
  Vec3d enu;
  local.Forward(latitude, longitude, altitude, enu.x(), enu.y(), enu.z());
  return enu;
}

GeoFrame frameAround(const std::vector<GpsFix>& fixes) {
  GeoFrame frame;
  if (fixes.empty()) return frame;
  std::vector<double> latitudes, longitudes;
  for (const GpsFix& fix : fixes) {
    latitudes.push_back(fix.latitude);
    longitudes.push_back(fix.longitude);
  }
  frame.latitude = upperMedian(latitudes);
  frame.longitude = upperMedian(longitudes);
  return frame;
}

std::optional<Georeference> georeference(const std::vector<Photo>& photos, const std::vector<int>& flights,
                                         std::string& reason) {
  CHECK((flights.empty() || flights.size() == photos.size()));
  // Fixes, those with absolute altitudes, with heights above take-off, and with both.
  int all = 0, known = 0, relative = 0, both = 0;
  for (const Photo& photo : photos) {
    if (!photo.gps) continue;
    ++all;
    known += photo.gps->hasAltitude ? 1 : 0;
    relative += photo.gps->relativeAltitude != 0 ? 1 : 0;
    both += photo.gps->hasAltitude && photo.gps->relativeAltitude != 0 ? 1 : 0;
  }
  // The others may be of another camera, or were taken on the ground.
  constexpr double kNearlyAll = 0.9;
  const bool nearlyAllRelative = relative >= kNearlyAll * all;
  const bool hasAltitudes = all == 0 || (known > 0 && 2 * known >= all);
  const Heights absolute = hasAltitudes ? Heights::absolute : Heights::unknown;
  Fitted best = fitTo(photos, flights, nearlyAllRelative ? Heights::aboveTakeOff : absolute, hasAltitudes);
  if (nearlyAllRelative && all > 0 && both == relative) {
    constexpr double kClearly = 0.7, kNothing = 0.05;  // share; metres
    Fitted other = fitTo(photos, flights, Heights::absolute, hasAltitudes);
    if (other.result && (!best.result || other.heightError + kNothing < kClearly * best.heightError)) {
      best = std::move(other);
      best.result->ignoresTakeOff = true;
    }
  }
  reason = best.reason;
  return best.result;
}

}  // namespace tessera
