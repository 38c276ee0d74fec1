#include "partition/heights.h"

#include <gtest/gtest.h>

#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

Heights findCaptureHeights(const Capture& capture) {
  return findHeights(capture, Ground{}, findRegion(capture, Ground{}));
}

TEST(Heights, ReachATenthBeyondTheMiddleOfThePoints) {
  Capture capture = flight(6, 6, 20, 60);
  addPoints(capture, 20000, {-60, -60, -1}, {160, 160, 9});
  const Heights heights = findCaptureHeights(capture);
  EXPECT_NEAR(heights.bottom, -2, 0.1);
  EXPECT_NEAR(heights.top, 10, 0.1);
}

TEST(Heights, LeaveRoomForTreesWhereThereAreNoPoints) {
  Capture capture = flight(6, 6, 20, 60);
  const Rectangle region = findRegion(capture, Ground{}).rectangle;
  const Vec2d low = region.centre - Vec2d(region.width, region.depth) / 2, high = 2 * region.centre - low;
  addPoints(capture, 20000, {low.x(), low.y(), -1}, {region.centre.x(), high.y(), 9}, 1);
  EXPECT_NEAR(findCaptureHeights(capture).top, 15, 1e-9) << "a quarter of the flight height";
  addPoints(capture, 20000, {region.centre.x(), low.y(), -1}, {high.x(), high.y(), 9}, 2);
  EXPECT_NEAR(findCaptureHeights(capture).top, 10, 0.1);
}

TEST(Heights, DoNotCutOffALoneTower) {
  Capture capture = flight(6, 6, 20, 60);
  addPoints(capture, 100000, {0, 0, -1}, {100, 100, 9}, 1);
  addPoints(capture, 150, {50, 50, 9}, {52, 52, 35}, 2);  // 0.15 % of the points
  EXPECT_GT(findCaptureHeights(capture).top, 34);
}

TEST(Heights, IgnoreAFewPointsInTheAirAndBelowTheGround) {
  Capture capture = flight(6, 6, 20, 60);
  addPoints(capture, 20000, {0, 0, -1}, {100, 100, 9}, 1);
  const Heights before = findCaptureHeights(capture);
  addPoints(capture, 15, {0, 0, 20}, {100, 100, 55}, 2);
  addPoints(capture, 15, {0, 0, -300}, {100, 100, -100}, 3);
  const Heights after = findCaptureHeights(capture);
  EXPECT_NEAR(after.top, before.top, 0.1);
  EXPECT_NEAR(after.bottom, before.bottom, 0.1);
}

TEST(Heights, IgnorePointsThatOnlyTwoPhotosMatchIfMostAreConfirmed) {
  Capture capture = flight(6, 6, 20, 60);
  addPoints(capture, 20000, {0, 0, -1}, {100, 100, 9}, 1);
  const Heights before = findCaptureHeights(capture);
  const auto observe = [&](size_t first, size_t end, uint32_t photos) {
    for (size_t point = first; point < end; ++point)
      for (uint32_t photo = 0; photo < photos; ++photo)
        capture.observations.push_back({photo, static_cast<uint32_t>(point)});
  };
  const size_t right = capture.points.size();
  addPoints(capture, 400, {0, 0, -300}, {100, 100, -100}, 2);  // windows that were mistaken for others
  const size_t all = capture.points.size();
  EXPECT_LT(findCaptureHeights(capture).bottom, -100) << "how many photos show them is not known";
  observe(0, right, 3);
  observe(right, all, 2);
  EXPECT_NEAR(findCaptureHeights(capture).bottom, before.bottom, 0.1);
  EXPECT_NEAR(findCaptureHeights(capture).top, before.top, 0.1);

  capture.observations.clear();
  observe(0, right / 3, 3);
  observe(right / 3, all, 2);
  EXPECT_LT(findCaptureHeights(capture).bottom, -100) << "most points are seen by two photos";
}

TEST(Heights, EndBelowTheHighestCameraOfAFlight) {
  Capture capture = flight(6, 6, 20, 60);
  addPoints(capture, 1000, {0, 0, -1}, {100, 100, 9}, 1);
  addPoints(capture, 100, {0, 0, 61}, {100, 100, 200}, 2);  // clouds, flares
  EXPECT_LT(findCaptureHeights(capture).top, 20);
  addPoints(capture, 100, {50, 50, 9}, {52, 52, 59}, 3);  // a mast as high as the flight
  EXPECT_EQ(findCaptureHeights(capture).top, 60);
}

TEST(Heights, KeepTowersBesideALowFlight) {
  Capture capture = flight(6, 6, 20, 120);
  for (int i = 0; i < 12; ++i) addPhoto(capture, lookingDown(10.0 * i, 0, 40));
  addPoints(capture, 1000, {0, 0, -1}, {100, 100, 9}, 1);
  addPoints(capture, 100, {50, 50, 9}, {55, 55, 80}, 2);
  EXPECT_GT(findCaptureHeights(capture).top, 79);
}

TEST(Heights, ReachAboveCamerasInsideTheScene) {
  Capture capture = orbit({0, 0, 1.6}, 5, 12);
  addPoints(capture, 3000, {-4, -4, 0}, {4, 4, 12});
  const Heights heights = findCaptureHeights(capture);
  EXPECT_NEAR(heights.bottom, -1.2, 0.2);
  EXPECT_NEAR(heights.top, 13.2, 0.2);
}

TEST(Heights, OnlyCountPointsOfTheRegion) {
  Capture capture = flight(6, 6, 20, 60);
  addPoints(capture, 3000, {-60, -60, -1}, {160, 160, 9}, 1);
  addPoints(capture, 3000, {1000, 1000, -50}, {1100, 1100, 50}, 2);  // hills far away
  const Heights heights = findCaptureHeights(capture);
  EXPECT_LT(heights.top, 11);
  EXPECT_GT(heights.bottom, -3);
}

TEST(Heights, ReachUpToTheFlightWithoutPoints) {
  const Heights heights = findCaptureHeights(flight(6, 6, 20, 60));
  EXPECT_EQ(heights.bottom, -6);
  EXPECT_EQ(heights.top, 60);
}

TEST(Heights, FormACubeForCamerasInsideASceneWithoutPoints) {
  const Heights heights = findCaptureHeights(orbit({0, 0, 1.6}, 5, 12));
  EXPECT_NEAR(heights.top - heights.bottom, 10, 0.1);
  EXPECT_NEAR(heights.top + heights.bottom, 3.2, 0.1);
}

TEST(Heights, HaveAMinimumThicknessOnAFlatPlane) {
  Capture capture = flight(6, 6, 20, 60);
  addPoints(capture, 1000, {0, 0, 0}, {100, 100, 0});
  const Heights heights = findCaptureHeights(capture);
  EXPECT_LT(heights.bottom, 0);
  EXPECT_GT(heights.top, 0);
}

}  // namespace
}  // namespace tessera
