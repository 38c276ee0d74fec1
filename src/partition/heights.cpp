#include "partition/heights.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/order_statistics.h"
#include "partition/cameras.h"

namespace tessera {
namespace {

constexpr double kOutliers = 0.002;     // fraction of points at either end
constexpr size_t kConfirming = 3;       // photos of a point: what only two photos match may be a mistake
constexpr double kConfirmed = 0.5;      // share of the points that are confirmed; if fewer are, all count
constexpr double kWider = 0.1;          // margin at either end, relative to the range
constexpr double kGap = 0.25;           // relative to the range: the range extends over points that follow within it
constexpr size_t kTogether = 3;         // number of points that must follow within the gap
constexpr double kMinThickness = 0.02;  // relative to the region's longer side, for flat ground
constexpr double kAround = 0.05;        // relative to the region's longer side: points up to here outside it count
constexpr double kBelowGround = 0.1;    // relative to the flight height, used where there are no points
constexpr int kSquares = 12;            // along each side of the region
constexpr double kBareShare = 0.1;      // of these squares: with more without points, the points do not show the top
constexpr double kTreeTops = 0.25;      // relative to the flight height: the top reaches up to there then

// Returns the share of the region's squares in which there is no point: in woods and on water, photos have hardly any
// features that match.
double findBareShare(const std::vector<SparsePoint>& points, const Ground& ground, const Rectangle& region) {
  std::array<bool, size_t{kSquares} * kSquares> hasPoints{};
  for (const SparsePoint& point : points) {
    const Vec2d at = region.inside(ground.inGround(point.xInWorld).head<2>());
    const auto square = [](double x, double length) {
      return static_cast<int>(std::floor((x / length + 0.5) * kSquares));
    };
    const int column = square(at.x(), region.width), row = square(at.y(), region.depth);
    if (column >= 0 && column < kSquares && row >= 0 && row < kSquares)
      hasPoints[static_cast<size_t>(row) * kSquares + static_cast<size_t>(column)] = true;
  }
  const auto bare = std::count(hasPoints.begin(), hasPoints.end(), false);
  return static_cast<double>(bare) / static_cast<double>(hasPoints.size());
}

// Returns the height of the lowest cameras above the ground.
double findFlightHeight(std::vector<double> cameras) {
  std::erase_if(cameras, [](double height) { return !(height > 0); });  // below the ground
  return cameras.empty() ? 0 : percentile(cameras, 0.05);
}

// Returns the heights of the points in the region, sorted: if enough photos confirm most points, of those alone.
std::vector<double> findPointHeights(const Capture& capture, const Ground& ground, const Region& region,
                                     double highestCamera) {
  const double side = std::max(region.rectangle.width, region.rectangle.depth);
  std::vector<size_t> photosOfPoint(capture.points.size());
  for (const Observation& observation : capture.observations) ++photosOfPoint[observation.point];
  std::vector<double> all, confirmed;
  for (size_t i = 0; i < capture.points.size(); ++i) {
    const Vec3d at = ground.inGround(capture.points[i].xInWorld);
    if (region.looksAtGround && at.z() > highestCamera) continue;
    if (!region.rectangle.holds(at.head<2>(), kAround * side)) continue;
    all.push_back(at.z());
    if (photosOfPoint[i] >= kConfirming) confirmed.push_back(at.z());
  }
  const bool suffice = static_cast<double>(confirmed.size()) >= kConfirmed * static_cast<double>(all.size()) &&
                       confirmed.size() >= kEnoughGroundPoints;
  std::vector<double>& heights = suffice ? confirmed : all;
  std::sort(heights.begin(), heights.end());
  return std::move(heights);
}

}  // namespace

Heights findHeights(const Capture& capture, const Ground& ground, const Region& region) {
  const double side = std::max(region.rectangle.width, region.rectangle.depth);
  const std::vector<int> photos = photosTogether(capture);
  std::vector<double> cameras;
  for (const int photo : photos) {
    cameras.push_back(ground.inGround(capture.photos[photo].worldFromCamera.translation).z());
  }
  const double highest = *std::max_element(cameras.begin(), cameras.end());

  const std::vector<double> heights = findPointHeights(capture, ground, region, highest);
  Heights extent;
  if (heights.size() >= kEnoughGroundPoints) {
    const auto rank = static_cast<size_t>(kOutliers * static_cast<double>(heights.size() - 1));
    const size_t first = rank;
    size_t last = heights.size() - 1 - rank;
    const double gap = kGap * (heights[last] - heights[first]);
    while (last + kTogether < heights.size() && heights[last + kTogether] - heights[last] <= gap) ++last;
    const double wider = kWider * (heights[last] - heights[first]);
    extent = {heights[first] - wider, heights[last] + wider};
    if (region.looksAtGround)
      extent = {std::min(extent.bottom, 0.0), std::clamp(extent.top, 0.0, std::max(highest, 0.0))};
  } else if (region.looksAtGround) {
    const double flight = findFlightHeight(cameras);
    extent = {-kBelowGround * flight, flight};
  } else {
    const double middle = ground.inGround(findFocusPoint(capture, photos)).z();
    extent = {middle - side / 2, middle + side / 2};
  }
  const double missing = kMinThickness * side - (extent.top - extent.bottom);
  if (missing > 0) extent = {extent.bottom - missing / 2, extent.top + missing / 2};
  if (region.looksAtGround && findBareShare(capture.points, ground, region.rectangle) > kBareShare)
    extent.top = std::max(extent.top, kTreeTops * findFlightHeight(std::move(cameras)));
  return extent;
}

}  // namespace tessera
