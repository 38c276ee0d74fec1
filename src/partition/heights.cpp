#include "partition/heights.h"

#include <algorithm>

#include "partition/cameras.h"

namespace tessera {
namespace {

constexpr double kOutliers = 0.002;       // at either end
constexpr double kWider = 0.1;            // of the range, at either end
constexpr double kGap = 0.25;             // of the range: what follows closer belongs to it
constexpr size_t kTogether = 3;           // so many points must follow within the gap
constexpr double kLeastThickness = 0.02;  // of the region's longer side: flat ground is not without thickness
constexpr double kAround = 0.05;          // of the region's longer side: points so far outside it count
constexpr double kBelowGround = 0.1;      // of the height of flight, where there are no points

}  // namespace

Heights findHeights(const Capture& capture, const Ground& ground, const Region& region) {
  const double side = std::max(region.rectangle.width, region.rectangle.depth);
  const std::vector<int> photos = photosTogether(capture);
  std::vector<double> cameras;
  for (const int photo : photos) {
    cameras.push_back(ground.inGround(capture.photos[photo].worldFromCamera.translation).z());
  }
  const double highest = *std::max_element(cameras.begin(), cameras.end());

  std::vector<double> heights;
  for (const SparsePoint& point : capture.points) {
    const Vec3d at = ground.inGround(point.xInWorld);
    if (region.looksAtGround && at.z() > highest) continue;
    if (region.rectangle.holds(at.head<2>(), kAround * side)) heights.push_back(at.z());
  }
  Heights found;
  if (heights.size() >= kEnoughGroundPoints) {
    std::sort(heights.begin(), heights.end());
    const auto rank = static_cast<size_t>(kOutliers * static_cast<double>(heights.size() - 1));
    const size_t first = rank;
    size_t last = heights.size() - 1 - rank;
    const double gap = kGap * (heights[last] - heights[first]);
    while (last + kTogether < heights.size() && heights[last + kTogether] - heights[last] <= gap) ++last;
    const double wider = kWider * (heights[last] - heights[first]);
    found = {heights[first] - wider, heights[last] + wider};
    if (region.looksAtGround) found = {std::min(found.bottom, 0.0), std::clamp(found.top, 0.0, std::max(highest, 0.0))};
  } else if (region.looksAtGround) {
    std::erase_if(cameras, [](double height) { return !(height > 0); });  // they see nothing of it
    const double lowest = percentile(cameras, 0.05);
    found = {-kBelowGround * lowest, lowest};
  } else {
    const double middle = ground.inGround(focusOf(capture, photos)).z();
    found = {middle - side / 2, middle + side / 2};
  }
  const double missing = kLeastThickness * side - (found.top - found.bottom);
  if (missing > 0) found = {found.bottom - missing / 2, found.top + missing / 2};
  return found;
}

}  // namespace tessera
