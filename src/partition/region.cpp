#include "partition/region.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/check.h"
#include "base/order_statistics.h"
#include "partition/cameras.h"
#include "partition/ray_fan.h"
#include "partition/rectangle.h"

namespace tessera {
namespace {

constexpr int kFanColumns = 24, kFanRows = 18;
constexpr int kMapSide = 256;  // cells of the coarse map along its longer side

// The projection of a part of a photo onto the ground.
using Quad = std::array<Vec2d, 4>;

// Returns the size of a pixel on the ground in its narrower direction, which is the smaller singular value of the map
// from the photo; `pixels` is the size of the part in the photo. Oblique rays stretch pixels along the ground, but that
// does not reduce the detail of upright surfaces.
double pixelWidth(const Quad& quad, const Vec2d& pixels) {
  const Vec2d right = (quad[1] - quad[0] + quad[2] - quad[3]) / (2 * pixels.x());
  const Vec2d down = (quad[3] - quad[0] + quad[2] - quad[1]) / (2 * pixels.y());
  const double sum = right.squaredNorm() + down.squaredNorm(), area = std::abs(cross(right, down));
  return area / std::sqrt(1e-300 + (sum + std::sqrt(std::max(0.0, sum * sum - 4 * area * area))) / 2);
}

// Returns the point where a ray meets the ground, or nothing if it does so at less than `minSlope` degrees or not at
// all.
std::optional<Vec2d> meetsGround(const Vec3d& originInGround, const Vec3d& direction, double minSlope) {
  const double fall = -direction.z();
  if (!(originInGround.z() > 0) || !(fall >= std::sin(minSlope * std::numbers::pi / 180))) return std::nullopt;
  return Vec2d((originInGround + originInGround.z() / fall * direction).head<2>());
}

struct Footprint {
  std::vector<Quad> quads;
  double groundPixel = 0;  // median over the quads
  bool axisMeets = false;  // whether the optical axis meets the ground
};

Footprint computeFootprint(const Camera& camera, const RayFan& fan, const Pose& worldFromCamera, const Ground& ground,
                           double minSlope) {
  const Mat3d groundFromCamera = ground.groundFromWorld * worldFromCamera.rotation;
  const Vec3d origin = ground.inGround(worldFromCamera.translation);
  Footprint footprint;
  footprint.axisMeets = meetsGround(origin, groundFromCamera.col(2), kMinAxisSlope).has_value();
  std::vector<std::optional<Vec2d>> hits;
  for (const std::optional<Vec3d>& direction : fan.directionsInCamera) {
    const Vec3d turned = direction ? Vec3d(groundFromCamera * *direction) : Vec3d::Zero();
    hits.push_back(meetsGround(origin, turned, minSlope));
  }
  const Vec2d pixels(static_cast<double>(camera.width) / kFanColumns, static_cast<double>(camera.height) / kFanRows);
  std::vector<double> widths;
  for (int row = 0; row < kFanRows; ++row) {
    for (int column = 0; column < kFanColumns; ++column) {
      const size_t first = static_cast<size_t>(row) * static_cast<size_t>(fan.columns) + static_cast<size_t>(column);
      const size_t below = first + static_cast<size_t>(fan.columns);
      if (!hits[first] || !hits[first + 1] || !hits[below] || !hits[below + 1]) continue;
      footprint.quads.push_back({*hits[first], *hits[first + 1], *hits[below + 1], *hits[below]});
      widths.push_back(pixelWidth(footprint.quads.back(), pixels));
    }
  }
  if (!widths.empty()) footprint.groundPixel = percentile(widths, 0.5);
  return footprint;
}

// Counts the photos that show each cell of a coarse map.
class CoverageMap {
 public:
  CoverageMap(const Vec2d& low, const Vec2d& high) : low_(low) {
    cell_ = std::max((high - low).maxCoeff() / kMapSide, 1e-300);
    columns_ = std::clamp(static_cast<int>(std::ceil((high - low).x() / cell_)), 1, kMapSide);
    rows_ = std::clamp(static_cast<int>(std::ceil((high - low).y() / cell_)), 1, kMapSide);
    counts_.resize(static_cast<size_t>(columns_) * rows_);
    lastPhoto_.resize(counts_.size(), -1);
  }

  void add(int photo, const Quad& quad) {
    addTriangle(photo, quad[0], quad[1], quad[2]);
    addTriangle(photo, quad[0], quad[2], quad[3]);
  }
  int maximum() const { return *std::max_element(counts_.begin(), counts_.end()); }

  // Returns the corners of the outermost cells in each row that at least `count` photos show.
  std::vector<Vec2d> outerCellCorners(int count) const {
    std::vector<Vec2d> corners;
    for (int row = 0; row < rows_; ++row) {
      const auto begin = counts_.begin() + static_cast<ptrdiff_t>(row) * columns_, end = begin + columns_;
      const auto enough = [count](int photos) { return photos >= count; };
      const auto first = std::find_if(begin, end, enough);
      if (first == end) continue;
      const auto last = std::find_if(std::reverse_iterator(end), std::reverse_iterator(begin), enough).base();
      for (const ptrdiff_t column : {first - begin, last - begin}) {
        for (const int side : {row, row + 1}) corners.push_back(low_ + cell_ * Vec2d(column, side));
      }
    }
    return corners;
  }

 private:
  void addTriangle(int photo, const Vec2d& a, const Vec2d& b, const Vec2d& c) {
    const Vec2d low = (a.cwiseMin(b).cwiseMin(c) - low_) / cell_, high = (a.cwiseMax(b).cwiseMax(c) - low_) / cell_;
    const int left = std::max(0, static_cast<int>(std::floor(low.x() - 0.5)));
    const int right = std::min(columns_ - 1, static_cast<int>(std::ceil(high.x() - 0.5)));
    const int bottom = std::max(0, static_cast<int>(std::floor(low.y() - 0.5)));
    const int top = std::min(rows_ - 1, static_cast<int>(std::ceil(high.y() - 0.5)));
    for (int row = bottom; row <= top; ++row) {
      for (int column = left; column <= right; ++column) {
        const Vec2d middle = low_ + cell_ * Vec2d(column + 0.5, row + 0.5);
        const double ab = cross(b - a, middle - a), bc = cross(c - b, middle - b), ca = cross(a - c, middle - c);
        if (std::min({ab, bc, ca}) < 0 && std::max({ab, bc, ca}) > 0) continue;
        const size_t at = static_cast<size_t>(row) * static_cast<size_t>(columns_) + static_cast<size_t>(column);
        counts_[at] += lastPhoto_[at] != photo;
        lastPhoto_[at] = photo;
      }
    }
  }

  Vec2d low_;
  double cell_;
  int columns_, rows_;
  std::vector<int> counts_, lastPhoto_;
};

Region regionOfPhotos(const std::vector<Footprint>& footprints) {
  Vec2d low = Vec2d::Constant(std::numeric_limits<double>::max()), high = -low;
  std::vector<double> widths;
  for (const Footprint& footprint : footprints) {
    for (const Quad& quad : footprint.quads) {
      for (const Vec2d& corner : quad) {
        low = low.cwiseMin(corner);
        high = high.cwiseMax(corner);
      }
    }
    if (!footprint.quads.empty()) widths.push_back(footprint.groundPixel);
  }
  CoverageMap map(low, high);
  for (size_t photo = 0; photo < footprints.size(); ++photo) {
    for (const Quad& quad : footprints[photo].quads) map.add(static_cast<int>(photo), quad);
  }
  const int enough = std::min(kEnoughPhotos, map.maximum());
  Region region;
  region.hull = convexHull(map.outerCellCorners(enough));
  region.rectangle = smallestRectangle(region.hull);
  region.groundPixel = percentile(widths, 0.5);
  region.how = fmt::format("what at least {} of {} photos show of the ground", enough, footprints.size());
  return region;
}

Region regionAmongThings(const Capture& capture, const std::vector<int>& photos, const Ground& ground) {
  Region region;
  region.looksAtGround = false;
  Vec3d centre = ground.inGround(findFocusPoint(capture, photos));
  double side = 0;
  if (capture.points.size() >= kEnoughRegionPoints) {
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> values;
      for (const SparsePoint& point : capture.points) values.push_back(ground.inGround(point.xInWorld)[axis]);
      const double low = percentile(values, 0.02), high = percentile(values, 0.98);
      centre[axis] = (low + high) / 2;
      if (axis < 2) side = std::max(side, high - low);
    }
    region.how = "a square about the points, as the cameras do not look at the ground";
  } else {
    for (const int photo : photos) {
      const Vec3d from = ground.inGround(capture.photos[photo].worldFromCamera.translation) - centre;
      side = std::max(side, 2 * from.head<2>().lpNorm<Eigen::Infinity>());
    }
    region.how = "a square about the cameras and what they look at, as that is not the ground";
  }
  if (!(side > 0)) side = 1;  // one camera, no points: the size is arbitrary
  region.rectangle = {centre.head<2>(), 0, side, side};
  std::vector<double> widths;
  for (const int photo : photos) {
    const Camera& camera = capture.cameras[capture.photos[photo].camera];
    const Vec3d from = ground.inGround(capture.photos[photo].worldFromCamera.translation) - centre;
    widths.push_back(from.norm() / std::max({camera.focalX(), camera.focalY(), 1e-9}));
  }
  region.groundPixel = std::max(percentile(widths, 0.5), side * 1e-6);
  return region;
}

}  // namespace

Region findRegion(const Capture& capture, const Ground& ground) {
  const std::vector<int> photos = photosTogether(capture);
  CHECK(photos.size() > 0u);
  std::vector<RayFan> fans;
  for (const Camera& camera : capture.cameras) fans.push_back(raysThroughCorners(camera, kFanColumns, kFanRows));
  for (const double minSlope : {kMinSlope, kMinSlope / 2}) {
    std::vector<Footprint> footprints;
    size_t looking = 0, showing = 0;
    for (const int photo : photos) {
      const int camera = capture.photos[photo].camera;
      footprints.push_back(computeFootprint(capture.cameras[camera], fans[static_cast<size_t>(camera)],
                                            capture.photos[photo].worldFromCamera, ground, minSlope));
      looking += footprints.back().axisMeets;
      showing += !footprints.back().quads.empty();
    }
    if (2 * looking >= photos.size() && 2 * showing >= photos.size()) return regionOfPhotos(footprints);
  }
  return regionAmongThings(capture, photos, ground);
}

}  // namespace tessera
