#include "scene/camera.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// A plausible lens of each model for a picture of 1600 × 1200.
Camera lensOf(LensModel model) {
  Camera camera{1600, 1200, model, {1, 2}};
  const bool oneFocal = camera.focalY() == camera.focalX();
  std::vector<double> p = oneFocal ? std::vector<double>{900, 810, 590} : std::vector<double>{900, 905, 810, 590};
  switch (model) {
    case LensModel::simpleRadial:
      p.insert(p.end(), {-0.08});
      break;
    case LensModel::radial:
      p.insert(p.end(), {-0.12, 0.03});
      break;
    case LensModel::openCv:
      p.insert(p.end(), {-0.13, 0.04, 1e-3, -8e-4});
      break;
    case LensModel::openCvFisheye:
      p.insert(p.end(), {0.03, -0.01, 2e-3, -3e-4});
      break;
    case LensModel::fullOpenCv:
      p.insert(p.end(), {0.1, -0.02, 1e-3, -5e-4, 0.005, 0.15, -0.01, 1e-3});
      break;
    case LensModel::fov:
      p.insert(p.end(), {0.9});
      break;
    case LensModel::simpleRadialFisheye:
      p.insert(p.end(), {-0.02});
      break;
    case LensModel::radialFisheye:
      p.insert(p.end(), {-0.02, 0.003});
      break;
    case LensModel::thinPrismFisheye:
      p.insert(p.end(), {0.03, -0.01, 1e-3, -7e-4, 1e-3, -2e-4, 4e-4, -6e-4});
      break;
    case LensModel::radTanThinPrismFisheye:
      p.insert(p.end(), {-0.02, 0.08, -0.06, 0.01, 1e-3, -1e-4, 7e-4, -3e-4, 5e-4, -1e-4, -4e-4, 2e-5});
      break;
    default:
      break;
  }
  EXPECT_EQ(static_cast<int>(p.size()), lensParameterCount(model));
  std::copy(p.begin(), p.end(), camera.parameters.begin());
  return camera;
}

class EveryLens : public testing::TestWithParam<int> {
 protected:
  Camera camera_ = lensOf(static_cast<LensModel>(GetParam()));
};

TEST_P(EveryLens, ProjectsBackToThePixelItCameFrom) {
  for (double y = 0; y <= 1200; y += 75) {
    for (double x = 0; x <= 1600; x += 80) {
      const auto direction = camera_.directionInCamera({x, y});
      ASSERT_TRUE(direction.has_value()) << x << " " << y;
      EXPECT_NEAR(direction->norm(), 1, 1e-14);
      const auto pixel = camera_.pixelFromCamera(*direction * 7.5);
      ASSERT_TRUE(pixel.has_value()) << x << " " << y;
      EXPECT_NEAR((*pixel - Vec2d(x, y)).norm(), 0, 1e-9);
    }
  }
}

TEST_P(EveryLens, LooksForwardAtItsPrincipalPoint) {
  const auto direction = camera_.directionInCamera({camera_.centreX(), camera_.centreY()});
  ASSERT_TRUE(direction.has_value());
  EXPECT_NEAR((*direction - Vec3d(0, 0, 1)).norm(), 0, 1e-12);
}

TEST_P(EveryLens, AgreesWithItselfInSinglePrecision) {
  std::array<float, 16> parameters;
  std::copy(camera_.parameters.begin(), camera_.parameters.end(), parameters.begin());
  for (float y = 0.5f; y < 1200; y += 113) {
    for (float x = 0.5f; x < 1600; x += 127) {
      float direction[3];
      ASSERT_TRUE(lensUnproject(camera_.lens, parameters.data(), x, y, direction)) << x << " " << y;
      const Vec3d expected = *camera_.directionInCamera({x, y});
      const Vec3d found = Eigen::Map<Vec3f>(direction).cast<double>();
      EXPECT_NEAR((found - expected).norm(), 0, 1e-5) << x << " " << y;  // a hundredth of a pixel
    }
  }
}

TEST_P(EveryLens, ScalesWithThePicture) {
  const Camera half = camera_.scaledTo(801, 599);  // odd on purpose: pixels are no longer square
  for (const Vec2d& pixel : {Vec2d(0, 0), Vec2d(1600, 1200), Vec2d(333, 1011)}) {
    const Vec2d scaled(pixel.x() * 801 / 1600, pixel.y() * 599 / 1200);
    EXPECT_NEAR((*half.directionInCamera(scaled) - *camera_.directionInCamera(pixel)).norm(), 0, 1e-12);
  }
}

TEST_P(EveryLens, IsFoundByItsName) {
  EXPECT_EQ(lensFromName(lensName(camera_.lens)), camera_.lens);
}

TEST_P(EveryLens, SeesNothingForNotANumber) {
  EXPECT_FALSE(camera_.directionInCamera({std::nan(""), 3}).has_value());
  EXPECT_FALSE(camera_.pixelFromCamera({std::nan(""), 0, 1}).has_value());
  camera_.parameters[0] = std::nan("");
  EXPECT_FALSE(camera_.directionInCamera({5, 3}).has_value());
}

INSTANTIATE_TEST_SUITE_P(Camera, EveryLens, testing::Range(0, kLensModelCount),
                         [](const auto& info) { return std::string(lensName(static_cast<LensModel>(info.param))); });

// Numbers worked out by hand from OpenCV's formula, so that signs and order of the tangential terms are pinned.
TEST(Camera, DistortsAsOpenCvDoes) {
  const Camera camera{100, 100, LensModel::openCv, {1, 1, 0, 0, 0.1, 0.01, 0.02, 0.03}};
  const Vec2d pixel = *camera.pixelFromCamera({0.5, -0.25, 1});
  const double r2 = 0.3125, radial = 1 + 0.1 * r2 + 0.01 * r2 * r2;
  EXPECT_NEAR(pixel.x(), 0.5 * radial + 2 * 0.02 * -0.125 + 0.03 * (r2 + 0.5), 1e-15);
  EXPECT_NEAR(pixel.y(), -0.25 * radial + 2 * 0.03 * -0.125 + 0.02 * (r2 + 0.125), 1e-15);
}

TEST(Camera, ProjectsFisheyeByAngle) {
  const Camera camera{100, 100, LensModel::openCvFisheye, {10, 10, 0, 0, 0.1, 0, 0, 0}};
  const double theta = 1.0;
  const Vec2d pixel = *camera.pixelFromCamera({std::sin(theta), 0, std::cos(theta)});
  EXPECT_NEAR(pixel.x(), 10 * 1.1, 1e-12);
  EXPECT_NEAR(pixel.y(), 0, 1e-12);
}

TEST(Camera, SeesBehindItselfThroughAFisheye) {
  const Camera camera{1000, 1000, LensModel::openCvFisheye, {200, 200, 500, 500, 0, 0, 0, 0}};
  const double theta = 110 * M_PI / 180;
  const auto direction = camera.directionInCamera({500 + 200 * theta, 500});
  ASSERT_TRUE(direction.has_value());
  EXPECT_NEAR((*direction - Vec3d(std::sin(theta), 0, std::cos(theta))).norm(), 0, 1e-12);
  EXPECT_NEAR(camera.pixelFromCamera(*direction)->x(), 500 + 200 * theta, 1e-9);
  EXPECT_FALSE(camera.pixelFromCamera({0, 0, -1}).has_value());
  EXPECT_FALSE(camera.directionInCamera({500 + 200 * 3.2, 500}).has_value());
}

TEST(Camera, HasNoRayBeyondTheFold) {
  // r(1 - 0.3 r²) is largest at r = 1.054, where it is 0.7027.
  const Camera camera{2000, 2000, LensModel::simpleRadial, {1000, 1000, 1000, -0.3}};
  EXPECT_TRUE(camera.directionInCamera({1000 + 702, 1000}).has_value());
  EXPECT_FALSE(camera.directionInCamera({1000 + 704, 1000}).has_value());
  EXPECT_TRUE(camera.pixelFromCamera({1.05, 0, 1}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({1.06, 0, 1}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({1.8, 0, 1}).has_value());  // would land inside the picture again
}

TEST(Camera, HasNoRayOnTheSecondBranchOfAPolynomial) {
  // Grows, folds near r = 0.85, grows again from r = 1.2: pixels that only the second branch reaches have no ray.
  const Camera camera{4000, 4000, LensModel::radial, {1000, 2000, 2000, -0.7, 0.19}};
  EXPECT_FALSE(camera.directionInCamera({2000 + 1500, 2000}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({2.2, 0, 1}).has_value());
}

TEST(Camera, SeesNothingBehindAPerspectiveLens) {
  const Camera camera{100, 100, LensModel::pinhole, {50, 50, 50, 50}};
  EXPECT_FALSE(camera.pixelFromCamera({0, 0, -1}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({0, 0, 0}).has_value());
}

TEST(Camera, KnowsNoLensOfAnotherName) {
  EXPECT_FALSE(lensFromName("BROWN_CONRADY").has_value());
}

}  // namespace
}  // namespace tessera
