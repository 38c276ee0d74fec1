#include "scene/contraction.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/random.h"

namespace tessera {
namespace {

using Point = Triple<double>;

class NearAndFarPoints {
 public:
  explicit NearAndFarPoints(uint64_t seed) : random_(seed, 0) {}
  // Returns a random point, near or far, inside or outside the cube.
  Point next() {
    Point x;
    const double reach = std::exp2(random_.uniformDouble(index_++) * 12 - 2);
    for (double& coordinate : x) coordinate = reach * (2 * random_.uniformDouble(index_++) - 1);
    return x;
  }
  Point direction() {
    Point d;
    for (double& coordinate : d) coordinate = 2 * random_.uniformDouble(index_++) - 1;
    return d;
  }

 private:
  RandomStream random_;
  uint64_t index_ = 0;
};

double squaredLength(const Point& x) {
  return x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
}

// Returns whether the points within h of x lie in one region, where the map is smooth.
bool isSmoothAt(Point x, double h) {
  for (double& coordinate : x) coordinate = std::abs(coordinate);
  std::sort(x.begin(), x.end());
  return std::abs(x[2] - 1) > h && (x[2] < 1 || x[2] - x[1] > h);
}

TEST(Contraction, MapsKnownPairsBothWays) {
  const std::pair<Point, Point> pairs[] = {{{2, 1, -.5}, {1.5, .5, -.25}},
                                           {{-4, 3, 1}, {-1.75, .75, .25}},
                                           {{1, -10, 2}, {.1, -1.9, .2}},
                                           {{1e6, 0, 0}, {1.999999, 0, 0}},
                                           {{.3, -1, .2}, {.3, -1, .2}}};
  for (const auto& [x, y] : pairs)
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(contract(x)[a], y[a], 1e-12);
      EXPECT_NEAR(uncontract(y)[a], x[a], std::max(1e-12, 1e-9 * std::abs(x[a])));
    }
}

TEST(Contraction, IsInvertibleEverywhere) {
  NearAndFarPoints points(1);
  int outside = 0;
  for (int n = 0; n < 2000; ++n) {
    const Point x = points.next(), y = contract(x), back = uncontract(y);
    const double far = std::abs(x[farthestAxis(x)]);
    outside += far > 1;
    for (int a = 0; a < 3; ++a) {
      EXPECT_LT(std::abs(y[a]), 2);
      EXPECT_NEAR(back[a], x[a], 1e-12 * std::max(1.0, far * far));
    }
  }
  EXPECT_GT(outside, 1000);
  EXPECT_LT(outside, 1950);
}

TEST(Contraction, LeavesTheCubeUnchanged) {
  for (const Point& x : {Point{0, 0, 0}, Point{.2, -.9, .4}, Point{1, -1, 1}}) {
    EXPECT_EQ(contract(x), x);
    EXPECT_EQ(uncontract(x), x);
    EXPECT_EQ(contractDirection(x, {1, 2, 3}), (Point{1, 2, 3}));
  }
}

TEST(Contraction, HasTheDerivativeOfFiniteDifferences) {
  NearAndFarPoints points(2);
  const double h = 1e-6;
  int compared = 0;
  for (int n = 0; n < 2000; ++n) {
    const Point x = points.next(), d = points.direction();
    if (!isSmoothAt(x, 10 * h)) continue;
    ++compared;
    Point before, after;
    for (int a = 0; a < 3; ++a) {
      before[a] = x[a] - h * d[a];
      after[a] = x[a] + h * d[a];
    }
    const Point y0 = contract(before), y1 = contract(after), along = contractDirection(x, d);
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(along[a], (y1[a] - y0[a]) / (2 * h), 1e-8);
  }
  EXPECT_GT(compared, 1900);
}

TEST(Contraction, KeepsLinesStraightWithinARegion) {
  const auto at = [](double t) { return contract(Point{1.5 + 0.7 * t, 0.2 + 0.3 * t, 0.2 * t - 0.3}); };
  const Point a = at(0), b = at(4), middle = at(1.3);
  const double share = (middle[0] - a[0]) / (b[0] - a[0]);
  EXPECT_GT(share, 0.5) << "the middle moves to the far end";
  for (int axis = 1; axis < 3; ++axis) EXPECT_NEAR(middle[axis], a[axis] + share * (b[axis] - a[axis]), 1e-12);
}

TEST(Contraction, StretchesAtMost1Point9319TimesAndAsMuchAtACorner) {
  NearAndFarPoints points(3);
  double maximum = 0;
  for (int n = 0; n < 20000; ++n) {
    Point x = points.next(), d = points.direction();
    if (n % 2 == 0)  // just outside a corner
      for (double& coordinate : x) coordinate = std::copysign(1 + 1e-6 * std::abs(coordinate), coordinate);
    const double stretch = std::sqrt(squaredLength(contractDirection(x, d)) / squaredLength(d));
    ASSERT_LE(stretch, 1.9319) << x[0] << ' ' << x[1] << ' ' << x[2];
    maximum = std::max(maximum, stretch);
  }
  EXPECT_GT(maximum, 1.92);
}

}  // namespace
}  // namespace tessera
