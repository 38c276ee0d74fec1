#include "partition/rectangle.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "partition/testing/made_captures.h"

namespace tessera {
namespace {

std::vector<Vec2d> cornersOf(const Rectangle& rectangle) {
  std::vector<Vec2d> corners;
  for (const Vec2d& side : {Vec2d(-1, -1), Vec2d(1, -1), Vec2d(1, 1), Vec2d(-1, 1)}) {
    corners.push_back(rectangle.outside(side.cwiseProduct(Vec2d(rectangle.width, rectangle.depth)) / 2));
  }
  return corners;
}

TEST(ConvexHull, HoldsAllPointsAndTurnsLeftEverywhere) {
  const RandomStream random(3, 0);
  std::vector<Vec2d> points;
  for (uint64_t i = 0; i < 500; ++i) points.emplace_back(random.below(2 * i, 20), random.below(2 * i + 1, 12));
  const std::vector<Vec2d> hull = convexHull(points);
  ASSERT_GE(hull.size(), 4u);
  for (size_t i = 0; i < hull.size(); ++i) {
    const Vec2d a = hull[i], edge = hull[(i + 1) % hull.size()] - a;
    for (const Vec2d& x : points) EXPECT_GE(edge.x() * (x - a).y() - edge.y() * (x - a).x(), 0);
    const Vec2d next = hull[(i + 2) % hull.size()] - a;
    EXPECT_GT(edge.x() * next.y() - edge.y() * next.x(), 0);  // no point on an edge
  }
}

TEST(ConvexHull, OfFewPointsAndOfALineIsWhatThereIs) {
  EXPECT_EQ(convexHull({{1, 2}, {1, 2}}).size(), 1u);
  EXPECT_EQ(convexHull({{0, 0}, {1, 1}, {2, 2}, {3, 3}}).size(), 2u);
}

TEST(SmallestRectangle, FindsATurnedOne) {
  for (const double degrees : {-40.0, -7.0, 12.0, 30.0, 44.0}) {
    const Rectangle made{{3, -8}, degrees * kDegree, 20, 5};
    const Rectangle found = smallestRectangle(convexHull(cornersOf(made)));
    EXPECT_NEAR(found.angle, made.angle, 1e-9);
    EXPECT_NEAR(found.width, 20, 1e-9);
    EXPECT_NEAR(found.depth, 5, 1e-9);
    EXPECT_LT((found.centre - made.centre).norm(), 1e-9);
  }
}

TEST(SmallestRectangle, TurnsByNoMoreThanFortyFiveDegrees) {
  const Rectangle found = smallestRectangle(convexHull(cornersOf({{0, 0}, 60 * kDegree, 20, 5})));
  EXPECT_NEAR(found.angle, -30 * kDegree, 1e-9);
  EXPECT_NEAR(found.width, 5, 1e-9);
  EXPECT_NEAR(found.depth, 20, 1e-9);
}

TEST(SmallestRectangle, IsTurnedOnlyWhereThatSavesSomething) {
  // A square with one corner cut off a little: its edges are level but for one.
  EXPECT_EQ(smallestRectangle(convexHull({{0, 0}, {9, 0}, {10, 1}, {10, 10}, {0, 10}})).angle, 0);
  EXPECT_EQ(smallestRectangle(convexHull(cornersOf({{0, 0}, 0.001, 10, 10}))).angle, 0);
}

TEST(SmallestRectangle, IsNeverLargerThanTheLevelBoxAndHoldsTheHull) {
  for (uint64_t trial = 0; trial < 50; ++trial) {
    const RandomStream random(trial, 9);
    std::vector<Vec2d> points;
    for (uint64_t i = 0; i < 12; ++i) points.emplace_back(random.uniform(2 * i), 3 * random.uniform(2 * i + 1));
    const std::vector<Vec2d> hull = convexHull(points);
    const Rectangle found = smallestRectangle(hull);
    Vec2d low = hull[0], high = low;
    for (const Vec2d& x : hull) {
      EXPECT_TRUE(found.holds(x, 1e-9));
      low = low.cwiseMin(x);
      high = high.cwiseMax(x);
    }
    EXPECT_LE(found.width * found.depth, (high - low).prod() * (1 + 1e-12));
    // No turn by whole degrees is smaller by more than is worth it.
    for (int degrees = -45; degrees < 45; ++degrees) {
      const Eigen::Rotation2Dd turn(degrees * kDegree);
      Vec2d least = turn * hull[0], most = least;
      for (const Vec2d& x : hull) {
        least = least.cwiseMin(turn * x);
        most = most.cwiseMax(turn * x);
      }
      EXPECT_GE((most - least).prod(), found.width * found.depth * (1 - kWorthTurning - 1e-9));
    }
  }
}

}  // namespace
}  // namespace tessera
