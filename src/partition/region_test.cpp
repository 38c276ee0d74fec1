#include "partition/region.h"

#include <gtest/gtest.h>

#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

// Returns the error of a map of 256 cells at either side.
double blur(double side) {
  return 1.5 * side / 256;
}

TEST(Region, IsTheFootprintOfASinglePhoto) {
  Capture capture = emptyCapture();
  addPhoto(capture, lookingDown(30, -20, 100));  // shows 200 × 150
  const Region region = findRegion(capture, Ground{});
  EXPECT_TRUE(region.looksAtGround);
  EXPECT_NEAR(region.rectangle.width, 200, 2 * blur(200));
  EXPECT_NEAR(region.rectangle.depth, 150, 2 * blur(200));
  EXPECT_NEAR(region.rectangle.centre.x(), 30, blur(200));
  EXPECT_NEAR(region.rectangle.centre.y(), -20, blur(200));
  EXPECT_EQ(region.rectangle.angle, 0);
  EXPECT_NEAR(region.groundPixel, 0.5, 1e-6);  // 100 / 200
}

TEST(Region, IsWhatThreePhotosShow) {
  // The footprints are 200 wide and 50 apart: photos 0…5 show [-100, 350], and three or more show [0, 250].
  const Region region = findRegion(flight(6, 1, 50, 100), Ground{});
  EXPECT_NEAR(region.rectangle.width, 250, 2 * blur(450));
  EXPECT_NEAR(region.rectangle.centre.x(), 125, blur(450));
  EXPECT_NEAR(region.rectangle.depth, 150, 2 * blur(450));
}

TEST(Region, IsTurnedWithTheFlight) {
  Capture capture = flight(8, 3, 50, 100);
  const Rectangle level = findRegion(capture, Ground{}).rectangle;
  turn(capture, turnAbout(Vec3d::UnitZ(), 30));
  const Rectangle turned = findRegion(capture, Ground{}).rectangle;
  EXPECT_NEAR(turned.angle, 30 * kDegree, 1.5 * kDegree);
  EXPECT_NEAR(turned.width, level.width, 0.03 * level.width);
  EXPECT_NEAR(turned.depth, level.depth, 0.05 * level.depth);
  EXPECT_LT((turned.centre - Eigen::Rotation2Dd(30 * kDegree) * level.centre).norm(), 0.02 * level.width);
}

TEST(Region, FollowsAGroundThatIsTiltedAndHigh) {
  Capture capture = flight(6, 1, 50, 100);
  const Mat3d rotation = turnAbout(Vec3d::UnitY(), 20);
  for (Photo& photo : capture.photos) photo.worldFromCamera.translation.z() += 40;
  turn(capture, rotation);
  Ground ground;
  ground.groundFromWorld = rotation.transpose();
  ground.height = 40;
  const Region region = findRegion(capture, ground);
  EXPECT_NEAR(region.rectangle.width, 250, 2 * blur(450));
  EXPECT_NEAR(region.rectangle.centre.x(), 125, blur(450));
  EXPECT_NEAR(region.groundPixel, 0.5, 1e-6);
}

TEST(Region, EndsBeforeTheHorizon) {
  Capture capture = emptyCapture();
  // The rays point 37° down in the centre and are level at the upper border.
  for (int i = 0; i < 3; ++i) {
    addPhoto(capture, lookingAt({0, 0, 100}, {0, 100 / std::tan(37 * kDegree), 0}, Vec3d::UnitZ()));
  }
  const Region region = findRegion(capture, Ground{});
  const double farthest = 100 / std::tan(kMinSlope * kDegree);
  double maximum = 0;
  for (const Vec2d& corner : region.hull) maximum = std::max(maximum, corner.norm());
  EXPECT_LE(maximum, farthest + 2 * blur(2 * farthest));
  EXPECT_GT(maximum, 0.8 * farthest);
}

TEST(Region, ReachesFartherWhereMostPhotosAreOblique) {
  Capture capture = emptyCapture();
  capture.cameras[0].parameters = {2000, 2000, 200, 150};  // ± 4.3°
  for (int i = 0; i < 4; ++i) {
    addPhoto(capture, lookingAt({0, 0, 100}, {0, 100 / std::tan(22 * kDegree), 0}, Vec3d::UnitZ()));
  }
  const Region region = findRegion(capture, Ground{});
  EXPECT_TRUE(region.looksAtGround);
  EXPECT_NEAR(region.rectangle.centre.y(), (100 / std::tan(17.7 * kDegree) + 100 / std::tan(26.3 * kDegree)) / 2, 2);
}

TEST(Region, CountsWhatAFisheyeShowsInsideItsCircle) {
  Capture capture = emptyCapture();
  Camera& camera = capture.cameras[0];
  camera.lens = LensModel::openCvFisheye;
  camera.parameters = {100, 100, 200, 150, 0, 0, 0, 0};  // 2 radians off the axis at the sides: beyond the horizon
  addPhoto(capture, lookingDown(0, 0, 10));
  const Region region = findRegion(capture, Ground{});
  const double reach = 10 / std::tan(kMinSlope * kDegree);
  EXPECT_GT(region.rectangle.width, 1.2 * reach);
  EXPECT_LT(region.rectangle.width, 2 * reach + 2 * blur(2 * reach));
  EXPECT_LT(region.rectangle.centre.norm(), blur(4 * reach));
}

TEST(Region, IsNotMovedByAPhotoFarAwayNorByHeldOutOnes) {
  Capture capture = flight(6, 3, 50, 100);
  const Region before = findRegion(capture, Ground{});
  addPhoto(capture, lookingDown(1e7, 1e7, 1e6));
  for (int i = 0; i < 5; ++i) {
    addPhoto(capture, lookingDown(500, 500, 100));
    capture.photos.back().split = Split::test;
  }
  const Region after = findRegion(capture, Ground{});
  EXPECT_EQ(after.rectangle.centre, before.rectangle.centre);
  EXPECT_EQ(after.rectangle.width, before.rectangle.width);
  EXPECT_EQ(after.groundPixel, before.groundPixel);
}

TEST(Region, IsASquareAroundThePointsForCamerasInsideTheScene) {
  Capture capture = orbit({5, 6, 1}, 4, 12);
  addPoints(capture, 2000, {3, 5, 0}, {7, 7, 2});
  const Region region = findRegion(capture, Ground{});
  EXPECT_FALSE(region.looksAtGround);
  EXPECT_TRUE(region.hull.empty());
  EXPECT_EQ(region.rectangle.width, region.rectangle.depth);
  EXPECT_NEAR(region.rectangle.width, 3.84, 0.1);  // 96 % of 4
  EXPECT_NEAR(region.rectangle.centre.x(), 5, 0.1);
  EXPECT_NEAR(region.rectangle.centre.y(), 6, 0.1);
}

TEST(Region, ReachesToTheCamerasInsideASceneWithoutPoints) {
  const Region region = findRegion(orbit({5, 6, 1}, 4, 12), Ground{});
  EXPECT_FALSE(region.looksAtGround);
  EXPECT_NEAR(region.rectangle.width, 8, 0.1);
  EXPECT_LT((region.rectangle.centre - Vec2d(5, 6)).norm(), 0.1);
  EXPECT_NEAR(region.groundPixel, 4.0 / 200, 1e-3);
}

TEST(Region, IsFiniteForCamerasThatLookAtTheSky) {
  for (const int count : {1, 5}) {
    Capture capture = emptyCapture();
    for (int i = 0; i < count; ++i) addPhoto(capture, lookingAt({2.0 * i, 0, 10}, {2.0 * i, 0, 50}, Vec3d::UnitY()));
    const Region region = findRegion(capture, Ground{});
    EXPECT_FALSE(region.looksAtGround);
    EXPECT_GT(region.rectangle.width, 0);
    EXPECT_TRUE(std::isfinite(region.rectangle.width) && region.rectangle.centre.allFinite());
    EXPECT_GT(region.groundPixel, 0);
  }
}

}  // namespace
}  // namespace tessera
