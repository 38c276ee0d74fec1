#include "representations/mesh/vulkan/raster_view.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

Camera makeCamera(LensModel lens, const std::vector<double>& parameters) {
  Camera camera;
  camera.width = 60;
  camera.height = 40;
  camera.lens = lens;
  std::copy(parameters.begin(), parameters.end(), camera.parameters.begin());
  return camera;
}

// Returns the number of views that show a direction at least half a pixel from their borders.
int countViews(const RasterViews& rasters, const Vec3d& direction) {
  int count = 0;
  for (const RasterView& view : rasters.views) {
    const Vec3d x = view.rasterFromCamera * direction;
    if (!(x.z() > 0)) continue;
    const double column = view.focalX * x.x() / x.z() + view.centreX, row = view.focalY * x.y() / x.z() + view.centreY;
    constexpr double kBorder = 0.5 - 1e-4;  // the middle of the first pixel, but for rounding errors
    if (column < kBorder || row < kBorder || column > view.width - kBorder || row > view.height - kBorder) continue;
    EXPECT_GE(x.normalized().z(), view.smallestCosine - 1e-9);
    ++count;
  }
  return count;
}

class RasterViewsOf : public testing::Test {
 protected:
  RasterViews make(const Camera& camera, uint32_t largestEdge = 16384) {
    directions_.update(camera, pool_);
    return makeRasterViews(directions_, largestEdge);
  }
  void expectAllDirections(const RasterViews& rasters) {
    const Camera& camera = directions_.camera();
    int seen = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const Vec3d direction = directions_.at(x, y).cast<double>();
        if (direction.isZero()) continue;
        EXPECT_GE(countViews(rasters, direction), 1) << x << ", " << y;
        ++seen;
      }
    }
    EXPECT_GT(seen, 0);
    for (const RasterView& view : rasters.views) {
      EXPECT_NEAR(view.rasterFromCamera.determinant(), 1, 1e-12);
      EXPECT_TRUE((view.rasterFromCamera * view.rasterFromCamera.transpose()).isIdentity(1e-12));
    }
  }

  ThreadPool pool_{1};
  PixelDirections directions_;
};

TEST_F(RasterViewsOf, PinholesHaveTheirPixels) {
  const RasterViews rasters = make(makeCamera(LensModel::pinhole, {50, 51, 29, 21}));
  EXPECT_TRUE(rasters.isSamePixels);
  ASSERT_EQ(rasters.views.size(), 1u);
  const RasterView& view = rasters.views.front();
  EXPECT_EQ(view.width, 60u);
  EXPECT_EQ(view.height, 40u);
  EXPECT_EQ(view.focalY, 51);
  EXPECT_EQ(view.centreX, 29);
  expectAllDirections(rasters);
}

TEST_F(RasterViewsOf, LensesWithDistortionHaveOneWithSmallerPixels) {
  const RasterViews rasters = make(makeCamera(LensModel::openCv, {50, 50, 30, 20, -0.15, 0.02, 0.002, -0.001}));
  EXPECT_FALSE(rasters.isSamePixels);
  ASSERT_EQ(rasters.views.size(), 1u);
  EXPECT_GE(rasters.views.front().focalX, 100);
  expectAllDirections(rasters);
}

TEST_F(RasterViewsOf, WideFisheyesHaveTheSidesOfACubeThatTheySee) {
  const RasterViews wide = make(makeCamera(LensModel::openCvFisheye, {20, 20, 30, 20, 0, 0, 0, 0}));
  EXPECT_EQ(wide.views.size(), 5u);
  expectAllDirections(wide);
  const RasterViews behind = make(makeCamera(LensModel::openCvFisheye, {10, 10, 30, 20, 0, 0, 0, 0}));
  EXPECT_EQ(behind.views.size(), 6u);
  expectAllDirections(behind);
}

TEST_F(RasterViewsOf, LargeImagesHaveAsManyPixelsAsTheDeviceAllows) {
  for (const LensModel lens : {LensModel::openCvFisheye, LensModel::openCv}) {
    const RasterViews rasters = make(makeCamera(lens, {40, 40, 30, 20, 0.01, 0, 0, 0}), 48);
    for (const RasterView& view : rasters.views) {
      EXPECT_LE(view.width, 48u);
      EXPECT_LE(view.height, 48u);
    }
    expectAllDirections(rasters);
  }
}

}  // namespace
}  // namespace tessera
