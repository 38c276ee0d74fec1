#include "representations/mesh/vulkan/raster_view.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {
namespace {

constexpr double kSmallestCosineOfOneView = 0.34;  // 70°
constexpr double kPixelsOfRaster = 2;              // along an edge of a pixel of the camera, in its middle

// Returns the smallest cosine of a position in the image with the axis.
double smallestCosine(const RasterView& view) {
  const double x = std::max(view.centreX, view.width - view.centreX) / view.focalX,
               y = std::max(view.centreY, view.height - view.centreY) / view.focalY;
  return 1 / std::sqrt(1 + x * x + y * y);
}

// A view of all directions whose slopes are within limits.
RasterView viewOfSlopes(const Mat3d& rasterFromCamera, const Vec2d& low, const Vec2d& high, double focal,
                        uint32_t largestEdge) {
  RasterView view;
  view.rasterFromCamera = rasterFromCamera;
  focal = std::min(focal, (largestEdge - 2) / (high - low).maxCoeff());
  view.focalX = view.focalY = focal;
  // A pixel more on each side, because of rounding errors.
  view.centreX = 1 - low.x() * focal;
  view.centreY = 1 - low.y() * focal;
  view.width = static_cast<uint32_t>(std::ceil((high.x() - low.x()) * focal)) + 2;
  view.height = static_cast<uint32_t>(std::ceil((high.y() - low.y()) * focal)) + 2;
  view.width = std::min(view.width, largestEdge);
  view.height = std::min(view.height, largestEdge);
  view.smallestCosine = smallestCosine(view);
  return view;
}

template <class Visit>
void forEachDirection(const PixelDirections& directions, const Visit& visit) {
  const Camera& camera = directions.camera();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      if (const Vec3f& direction = directions.at(x, y); !direction.isZero()) visit(direction);
}

// The sides of a cube that the camera sees.
std::vector<RasterView> cubeViews(const PixelDirections& directions, double focal, uint32_t largestEdge) {
  std::array<bool, 6> isSeen{};
  forEachDirection(directions, [&](const Vec3f& direction) {
    int axis = 0;
    direction.cwiseAbs().maxCoeff(&axis);
    isSeen[2 * axis + (direction[axis] < 0 ? 1 : 0)] = true;
  });
  std::vector<RasterView> views;
  for (int side = 0; side < 6; ++side) {
    if (!isSeen[side]) continue;
    const int axis = side / 2;
    Mat3d rasterFromCamera = Mat3d::Zero();  // a rotation: its rows are the axes of the raster
    const double sign = side % 2 == 0 ? 1 : -1;
    rasterFromCamera(0, (axis + 1) % 3) = sign;
    rasterFromCamera(1, (axis + 2) % 3) = 1;
    rasterFromCamera(2, axis) = sign;
    views.push_back(viewOfSlopes(rasterFromCamera, {-1, -1}, {1, 1}, focal, largestEdge));
  }
  return views;
}

}  // namespace

RasterViews makeRasterViews(const PixelDirections& directions, uint32_t largestEdge) {
  const Camera& camera = directions.camera();
  const double focal = kPixelsOfRaster * std::max(camera.focalX(), camera.focalY());
  Vec2d low = Vec2d::Constant(INFINITY), high = Vec2d::Constant(-INFINITY);
  double cosine = 1;
  forEachDirection(directions, [&](const Vec3f& direction) {
    cosine = std::min(cosine, static_cast<double>(direction.z()));
    if (!(direction.z() > 0)) return;
    const Vec2d slope = (direction.head<2>() / direction.z()).cast<double>();
    low = low.cwiseMin(slope);
    high = high.cwiseMax(slope);
  });
  RasterViews all;
  if (isPinhole(camera.lens) && camera.width <= static_cast<int>(largestEdge) &&
      camera.height <= static_cast<int>(largestEdge)) {
    RasterView view;
    view.focalX = camera.focalX();
    view.focalY = camera.focalY();
    view.centreX = camera.centreX();
    view.centreY = camera.centreY();
    view.width = static_cast<uint32_t>(camera.width);
    view.height = static_cast<uint32_t>(camera.height);
    view.smallestCosine = smallestCosine(view);
    all.views = {view};
    all.isSamePixels = true;
  } else if (low.x() <= high.x() && cosine >= kSmallestCosineOfOneView) {
    all.views = {viewOfSlopes(Mat3d::Identity(), low, high, focal, largestEdge)};
  } else {
    all.views = cubeViews(directions, focal, largestEdge);
  }
  return all;
}

}  // namespace tessera
