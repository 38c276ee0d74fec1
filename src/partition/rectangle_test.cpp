#include "partition/rectangle.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

std::vector<Vec2d> rectangleCorners(const Rectangle& rectangle) {
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

TEST(ConvexHull, HasFewerThanThreeCornersForPointsOnALine) {
  EXPECT_EQ(convexHull({{1, 2}, {1, 2}}).size(), 1u);
  EXPECT_EQ(convexHull({{0, 0}, {1, 1}, {2, 2}, {3, 3}}).size(), 2u);
}

TEST(SmallestRectangle, FindsARotatedRectangle) {
  for (const double degrees : {-40.0, -7.0, 12.0, 30.0, 44.0}) {
    const Rectangle expected{{3, -8}, degrees * kDegree, 20, 5};
    const Rectangle actual = smallestRectangle(convexHull(rectangleCorners(expected)));
    EXPECT_NEAR(actual.angle, expected.angle, 1e-9);
    EXPECT_NEAR(actual.width, 20, 1e-9);
    EXPECT_NEAR(actual.depth, 5, 1e-9);
    EXPECT_LT((actual.centre - expected.centre).norm(), 1e-9);
  }
}

TEST(SmallestRectangle, TurnsByNoMoreThanFortyFiveDegrees) {
  const Rectangle actual = smallestRectangle(convexHull(rectangleCorners({{0, 0}, 60 * kDegree, 20, 5})));
  EXPECT_NEAR(actual.angle, -30 * kDegree, 1e-9);
  EXPECT_NEAR(actual.width, 5, 1e-9);
  EXPECT_NEAR(actual.depth, 20, 1e-9);
}

TEST(SmallestRectangle, IsTurnedOnlyWhereThatSavesSomething) {
  // A square with one corner cut off slightly: all its edges but one are parallel to the axes.
  EXPECT_EQ(smallestRectangle(convexHull({{0, 0}, {9, 0}, {10, 1}, {10, 10}, {0, 10}})).angle, 0);
  EXPECT_EQ(smallestRectangle(convexHull(rectangleCorners({{0, 0}, 0.001, 10, 10}))).angle, 0);
}

TEST(SmallestRectangle, IsNeverLargerThanTheLevelBoxAndHoldsTheHull) {
  for (uint64_t trial = 0; trial < 50; ++trial) {
    const RandomStream random(trial, 9);
    std::vector<Vec2d> points;
    for (uint64_t i = 0; i < 12; ++i) points.emplace_back(random.uniform(2 * i), 3 * random.uniform(2 * i + 1));
    const std::vector<Vec2d> hull = convexHull(points);
    const Rectangle actual = smallestRectangle(hull);
    Vec2d low = hull[0], high = low;
    for (const Vec2d& x : hull) {
      EXPECT_TRUE(actual.holds(x, 1e-9));
      low = low.cwiseMin(x);
      high = high.cwiseMax(x);
    }
    EXPECT_LE(actual.width * actual.depth, (high - low).prod() * (1 + 1e-12));
    // No box at a whole number of degrees is smaller by more than kWorthTurning.
    for (int degrees = -45; degrees < 45; ++degrees) {
      const Eigen::Rotation2Dd turn(degrees * kDegree);
      Vec2d minimum = turn * hull[0], maximum = minimum;
      for (const Vec2d& x : hull) {
        minimum = minimum.cwiseMin(turn * x);
        maximum = maximum.cwiseMax(turn * x);
      }
      EXPECT_GE((maximum - minimum).prod(), actual.width * actual.depth * (1 - kWorthTurning - 1e-9));
    }
  }
}

}  // namespace
}  // namespace tessera
