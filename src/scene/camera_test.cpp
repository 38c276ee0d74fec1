#include "scene/camera.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// Returns a plausible lens of each model for an image of 1600 × 1200 pixels.
Camera makeLensCamera(LensModel model) {
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
    case LensModel::simpleDivision:
    case LensModel::division:
      p.insert(p.end(), {-0.15});
      break;
    case LensModel::eucm:
      p.insert(p.end(), {0.6, 1.1});
      break;
    default:
      break;
  }
  EXPECT_EQ(static_cast<int>(p.size()), lensParameterCount(model));
  std::copy(p.begin(), p.end(), camera.parameters.begin());
  return camera;
}

class EveryLens : public testing::TestWithParam<LensModel> {
 protected:
  Camera camera_ = makeLensCamera(GetParam());
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
      const Vec3d actual = Eigen::Map<Vec3f>(direction).cast<double>();
      EXPECT_NEAR((actual - expected).norm(), 0, 1e-5) << x << " " << y;  // a hundredth of a pixel
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

TEST_P(EveryLens, IsFoundByItsNumber) {
  EXPECT_EQ(lensFromNumber(static_cast<int>(camera_.lens)), camera_.lens);
}

TEST_P(EveryLens, SeesNothingForNotANumber) {
  EXPECT_FALSE(camera_.directionInCamera({std::nan(""), 3}).has_value());
  EXPECT_FALSE(camera_.pixelFromCamera({std::nan(""), 0, 1}).has_value());
  camera_.parameters[0] = std::nan("");
  EXPECT_FALSE(camera_.directionInCamera({5, 3}).has_value());
}

INSTANTIATE_TEST_SUITE_P(Camera, EveryLens, testing::ValuesIn(kLensModels),
                         [](const auto& info) { return std::string(lensName(info.param)); });

// The numbers are computed by hand from OpenCV's formula, to check the signs and the order of the tangential terms.
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

TEST(Camera, ProjectsByDivision) {
  // Computed by hand: the pixel at r = 0.5 looks along (0.5, 0, 1 + k/4).
  for (const double k : {-0.4, 0.4}) {
    const Camera camera{100, 100, LensModel::division, {20, 40, 3, 5, k}};
    const Vec3d expected = Vec3d(0.3, -0.4, 1 + k / 4).normalized();
    EXPECT_NEAR((*camera.directionInCamera({3 + 20 * 0.3, 5 - 40 * 0.4}) - expected).norm(), 0, 1e-15);
    EXPECT_NEAR((*camera.pixelFromCamera(expected * 7) - Vec2d(9, -11)).norm(), 0, 1e-13);
  }
}

TEST(Camera, SeesBehindItselfByDivision) {
  const Camera camera{4000, 4000, LensModel::simpleDivision, {500, 2000, 2000, -0.25}};
  for (const double r : {1.9999, 2.0, 2.5, 3.9}) {  // 90° at r = 2
    const auto direction = camera.directionInCamera({2000 + 500 * r, 2000});
    ASSERT_TRUE(direction.has_value());
    EXPECT_NEAR((*direction - Vec3d(r, 0, 1 - 0.25 * r * r).normalized()).norm(), 0, 1e-15);
    EXPECT_NEAR(camera.pixelFromCamera(*direction)->x(), 2000 + 500 * r, 1e-9);
  }
  EXPECT_FALSE(camera.pixelFromCamera({0, 0, -1}).has_value());
}

TEST(Camera, HasNoRayBeyondTheFoldOfADivision) {
  // k = 0.25 folds at r = 2, where the direction is (2, 0, 2).
  const Camera camera{4000, 4000, LensModel::simpleDivision, {500, 2000, 2000, 0.25}};
  EXPECT_TRUE(camera.directionInCamera({2000 + 500 * 1.99, 2000}).has_value());
  EXPECT_FALSE(camera.directionInCamera({2000 + 500 * 2.01, 2000}).has_value());
  EXPECT_NEAR(camera.pixelFromCamera({0.99, 0, 1})->x(), 2000 + 500 * 1.736, 1);
  EXPECT_FALSE(camera.pixelFromCamera({1.01, 0, 1}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({0.5, 0, -1}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({0, 0, -1}).has_value());
}

TEST(Camera, ProjectsByTheEnhancedUnifiedModel) {
  const Camera camera{100, 100, LensModel::eucm, {20, 40, 3, 5, 0.6, 1.3}};
  const double rho = std::sqrt(1.3 * (0.25 + 0.0625) + 1), divisor = 0.6 * rho + 0.4;
  const Vec2d pixel = *camera.pixelFromCamera({0.5, -0.25, 1});
  EXPECT_NEAR(pixel.x(), 3 + 20 * 0.5 / divisor, 1e-14);
  EXPECT_NEAR(pixel.y(), 5 - 40 * 0.25 / divisor, 1e-14);
  const Camera pinhole{100, 100, LensModel::eucm, {20, 40, 3, 5, 0, 1}};
  EXPECT_NEAR((*pinhole.pixelFromCamera({1, 2, 4}) - Vec2d(8, 25)).norm(), 0, 1e-14);
  EXPECT_FALSE(pinhole.pixelFromCamera({1, 2, -4}).has_value());
}

TEST(Camera, SeesThroughTheEnhancedUnifiedModelUpToItsFold) {
  for (const double alpha : {0.3, 0.5, 0.6, 0.8, 1.0}) {
    const Camera camera{4000, 4000, LensModel::eucm, {500, 500, 2000, 2000, alpha, 1.2}};
    double last = 0, widest = 0;
    for (double theta = 0.01; theta < 3.14; theta += 0.01) {
      const Vec3d direction(std::sin(theta), 0, std::cos(theta));
      const auto pixel = camera.pixelFromCamera(direction);
      if (!pixel) break;
      EXPECT_GT(pixel->x() - 2000, last) << alpha << " " << theta;
      last = pixel->x() - 2000;
      widest = theta;
      const auto back = camera.directionInCamera(*pixel);
      ASSERT_TRUE(back.has_value()) << alpha << " " << theta;
      EXPECT_NEAR((*back - direction).norm(), 0, 1e-7) << alpha << " " << theta;
    }
    EXPECT_EQ(widest > M_PI / 2, alpha < 1) << alpha;
    if (alpha <= 0.5) continue;
    const double fold = 500 / std::sqrt(1.2 * (2 * alpha - 1));
    EXPECT_NEAR(last, fold, 0.01 * fold);
    EXPECT_FALSE(camera.directionInCamera({2000 + 1.001 * fold, 2000}).has_value());
  }
  const Camera none{4000, 4000, LensModel::eucm, {500, 500, 2000, 2000, 1.5, 1.2}};
  EXPECT_FALSE(none.directionInCamera({2100, 2000}).has_value());
  EXPECT_FALSE(none.pixelFromCamera({0.1, 0, 1}).has_value());
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
  EXPECT_FALSE(camera.pixelFromCamera({1.8, 0, 1}).has_value());  // would be projected into the image again
}

TEST(Camera, HasNoRayOnTheSecondBranchOfAPolynomial) {
  // The polynomial grows, folds near r = 0.85, and grows again from r = 1.2: pixels that only the second branch reaches
  // have no ray.
  const Camera camera{4000, 4000, LensModel::radial, {1000, 2000, 2000, -0.7, 0.19}};
  EXPECT_FALSE(camera.directionInCamera({2000 + 1500, 2000}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({2.2, 0, 1}).has_value());
}

TEST(Camera, SeesNothingBehindAPerspectiveLens) {
  const Camera camera{100, 100, LensModel::pinhole, {50, 50, 50, 50}};
  EXPECT_FALSE(camera.pixelFromCamera({0, 0, -1}).has_value());
  EXPECT_FALSE(camera.pixelFromCamera({0, 0, 0}).has_value());
}

TEST(Camera, RejectsUnknownLensNames) {
  EXPECT_FALSE(lensFromName("BROWN_CONRADY").has_value());
  for (const int number : {-1, 14, 17}) EXPECT_FALSE(lensFromNumber(number).has_value());
}

}  // namespace
}  // namespace tessera
