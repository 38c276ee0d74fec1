#include "partition/ground.h"

#include <gtest/gtest.h>

#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

// Returns a flight 50 above flat ground at z = 3, with roofs 10 to 20 above the ground.
Capture flightOverHouses() {
  Capture capture = flight(4, 4, 25, 53);
  addPoints(capture, 2000, {-50, -50, 2.9}, {120, 120, 3.1}, 1);
  for (int house = 0; house < 6; ++house) {
    const double x = 20 * house, height = 13 + 2 * house;
    addPoints(capture, 150, {x, x, 3}, {x + 12, x + 12, height}, 10 + house);
    addPoints(capture, 150, {x, x, height}, {x + 12, x + 12, height}, 20 + house);
  }
  return capture;
}

TEST(Ground, IsTheFloorUnderHouses) {
  const Ground ground = findGround(flightOverHouses());
  EXPECT_LT(degreesBetween(ground.up(), Vec3d::UnitZ()), 0.3);
  EXPECT_NEAR(ground.inGround({30, 30, 3}).z(), 0, 0.3);
}

TEST(Ground, IsTheFloorEvenWhereAFlatRoofHasMorePoints) {
  Capture capture = flightOverHouses();
  addPoints(capture, 3500, {-50, -50, 14.9}, {60, 60, 15.1}, 99);  // a warehouse
  EXPECT_NEAR(findGround(capture).inGround({30, 30, 3}).z(), 0, 0.3);
}

TEST(Ground, IsFoundWhereItIsTilted) {
  for (const double degrees : {5.0, 12.0, 25.0}) {
    Capture capture = flightOverHouses();
    const Mat3d rotation = turnAbout({1, 2, 0}, degrees);
    turn(capture, rotation);
    const Ground ground = findGround(capture);
    EXPECT_LT(degreesBetween(ground.up(), rotation.col(2)), 0.3) << degrees;
    EXPECT_NEAR(ground.inGround(rotation * Vec3d(30, 30, 3)).z(), 0, 0.3) << degrees;
  }
}

TEST(Ground, RejectsPlanesSteeperThanThirtyDegrees) {
  Capture capture = flightOverHouses();
  turn(capture, turnAbout({1, 2, 0}, 40));
  EXPECT_LT(degreesBetween(findGround(capture).up(), Vec3d::UnitZ()), 1e-6);
}

TEST(Ground, IsNotFittedToAFacade) {
  Capture capture = orbit({0, 0, 0}, 20, 12);
  addPoints(capture, 3000, {-20, 5, 0}, {20, 5, 30}, 1);    // a wall
  addPoints(capture, 600, {-20, -10, 0}, {20, 5, 0.1}, 2);  // the street before it
  const Ground ground = findGround(capture);
  EXPECT_LT(degreesBetween(ground.up(), Vec3d::UnitZ()), 2);
  EXPECT_NEAR(ground.height, 0, 1);
}

TEST(Ground, KeepsTheWorldsUpWhereThePointsAreACloud) {
  Capture capture = orbit({0, 0, 0}, 20, 12);
  addPoints(capture, 3000, {-10, -10, -10}, {10, 10, 10});
  EXPECT_LT(degreesBetween(findGround(capture).up(), Vec3d::UnitZ()), 1e-6);
}

TEST(Ground, TakesUpFromTheGeoReference) {
  Capture capture = flightOverHouses();  // the ground is level; the hill below is not
  capture.points.clear();
  addPoints(capture, 2000, {-50, -50, 3}, {120, 120, 3});
  for (SparsePoint& point : capture.points) point.xInWorld.z() += 0.2 * point.xInWorld.x();
  capture.geo = GeoFrame{};
  EXPECT_LT(degreesBetween(findGround(capture).up(), Vec3d::UnitZ()), 1e-6);
  const Mat3d rotation = turnAbout({0, 1, 0}, 50);
  turn(capture, rotation);
  EXPECT_LT(degreesBetween(findGround(capture).up(), rotation.col(2)), 1e-6);
}

TEST(Ground, UsesTheHeightAboveTakeOffWithoutPoints) {
  Capture capture = flight(4, 4, 25, 53);
  capture.geo = GeoFrame{};
  capture.geo->enuFromWorld.diagonal().head<3>().setConstant(2);  // a unit is two metres
  for (Photo& photo : capture.photos) photo.gps = GpsFix{.relativeAltitude = 100};
  EXPECT_NEAR(findGround(capture).height, 3, 1e-9);
}

TEST(Ground, LiesWhereTheAxesMeetWithoutPoints) {
  Capture capture = emptyCapture();
  for (int i = 0; i < 8; ++i) {
    const double angle = 45 * kDegree * i;
    addPhoto(capture, lookingAt({30 * std::cos(angle), 30 * std::sin(angle), 25}, {0, 0, -4}, Vec3d::UnitZ()));
  }
  EXPECT_NEAR(findGround(capture).height, -4, 0.1);
}

TEST(Ground, LiesBelowANadirFlightWithoutPoints) {
  const Ground ground = findGround(flight(5, 3, 25, 80));
  EXPECT_LT(ground.height, 60);
  EXPECT_GT(ground.height, -200);
  EXPECT_NE(ground.how.find("guessed"), std::string::npos) << ground.how;
}

TEST(Ground, LiesBelowASingleCamera) {
  Capture capture = emptyCapture();
  addPhoto(capture, lookingDown(1, 2, 3));
  const Ground ground = findGround(capture);
  EXPECT_LT(ground.height, 3);
  EXPECT_TRUE(std::isfinite(ground.height));
}

TEST(Ground, LiesAtPointsThatCoincide) {
  Capture capture = flight(2, 2, 10, 20);
  capture.points.resize(100);
  const Ground ground = findGround(capture);
  EXPECT_NEAR(ground.height, 0, 1e-9);
  EXPECT_LT(degreesBetween(ground.up(), Vec3d::UnitZ()), 1e-6);
}

TEST(Ground, ConvertsCoordinatesToTheWorldAndBack) {
  Ground ground;
  ground.groundFromWorld = turnAbout({1, 2, 3}, 40);
  ground.height = 7;
  const Vec3d x(5, -3, 11);
  EXPECT_LT((ground.inWorld(ground.inGround(x)) - x).norm(), 1e-12);
  EXPECT_NEAR(ground.inGround(ground.up() * 9).z(), 2, 1e-12);
}

}  // namespace
}  // namespace tessera
