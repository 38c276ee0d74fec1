#include "representations/volume/cpu/volume_path.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "raymarch/testing/random_parts.h"
#include "scene/contraction.h"

namespace tessera {
namespace {

using tiles_test::randomVector;

VolumePart contractedPart() {
  VolumePart part;
  part.contracted = true;
  part.centre = {0.5f, -0.25f, 0};
  part.scale = {3, 2, 1};
  part.planes = 512;
  return part;
}

Triple<double> texelAt(const VolumePart& part, const SceneRay& ray, double t) {
  Triple<double> q;
  for (int a = 0; a < 3; ++a) q[a] = (ray.origin[a] + t * ray.direction[a] - part.centre[a]) / part.scale[a];
  q = part.contracted ? contract(q) : q;
  for (double& value : q) value = (value + part.halfDomain()) * part.planes / (2 * part.halfDomain());
  return q;
}

TEST(VolumePath, FollowsTheContractionThroughAtMostFiveRegions) {
  const VolumePart part = contractedPart();
  const RandomStream random(1, 1);
  int maximum = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const SceneRay ray{randomVector(random, 2 * i, i % 2 ? 2 : 20), randomVector(random, 2 * i + 1, 1).normalized()};
    const VolumePath path = volumePath(part, ray, {0.05, 1e4});
    ASSERT_LE(path.count, 5);
    maximum = std::max(maximum, path.count);
    double end = 0.05;
    for (int k = 0; k < path.count; ++k) {
      const VolumeSegment& s = path.segments[k];
      EXPECT_NEAR(1 / (1 + s.entry), 1 / (1 + end), 2e-6);  // lengths are floats
      for (const double share : {0.001, 0.1, 0.5, 0.9, 0.999}) {
        const double tau = share * s.length, t = s.distanceAt(tau);
        const Triple<double> expected = texelAt(part, ray, t);
        for (int a = 0; a < 3; ++a) ASSERT_NEAR(s.start[a] + tau * s.direction[a], expected[a], 2e-3) << i << " " << k;
      }
      EXPECT_NEAR(s.distanceBetween(0.2 * s.length, 0.3 * s.length),
                  s.distanceAt(0.3 * s.length) - s.distanceAt(0.2 * s.length),
                  1e-9 * (1 + s.distanceAt(0.3 * s.length)));
      end = s.distanceAt(s.length);
    }
    EXPECT_NEAR(1 / end, 1e-4, 2e-6);
  }
  EXPECT_EQ(maximum, 5);
}

TEST(VolumePath, MeetsTheRegionsThatDenseSamplingFindsInOrder) {
  const VolumePart part = contractedPart();
  const RandomStream random(2, 1);
  int regionsMet = 0;
  for (uint64_t i = 0; i < 300; ++i) {
    const SceneRay ray{randomVector(random, 2 * i, 8), randomVector(random, 2 * i + 1, 1).normalized()};
    const VolumePath path = volumePath(part, ray, {0.05, 60});
    const auto regionAt = [&](double t) {
      Triple<double> q;
      for (int a = 0; a < 3; ++a) q[a] = (ray.origin[a] + t * ray.direction[a] - part.centre[a]) / part.scale[a];
      const int axis = farthestAxis(q);
      return std::abs(q[axis]) > 1 ? 2 * axis + (q[axis] > 0) : 6;
    };
    std::vector<int> regions;  // of the segments
    for (int k = 0; k < path.count; ++k) {
      const VolumeSegment& s = path.segments[k];
      regions.push_back(regionAt(s.distanceAt(0.5 * s.length)));
      if (k > 0) {
        EXPECT_NE(regions[k], regions[k - 1]) << "one region in two segments, ray " << i;
      }
    }
    int piece = 0;
    for (int look = 0; look <= 20000; ++look) {
      const double t = 0.05 + look * (60 - 0.05) / 20000;
      while (piece + 1 < path.count && path.segments[piece + 1].entry <= t) ++piece;
      const double next = piece + 1 < path.count ? path.segments[piece + 1].entry : INFINITY;
      if (t - path.segments[piece].entry < 1e-9 || next - t < 1e-9) continue;  // rounding decides the side
      ASSERT_EQ(regions[piece], regionAt(t)) << "ray " << i << " at " << t;
    }
    regionsMet += path.count;
  }
  EXPECT_GT(regionsMet, 600);
}

TEST(VolumePath, IsOneStraightPieceInABoundedPart) {
  VolumePart part;
  part.planes = 256;
  part.centre = {2, 4, 0};
  part.scale = {1, 2, 0.5f};
  const SceneRay ray{Vec3d(1.5, 3, -0.4), Vec3d(0.3, 0.8, 0.2).normalized()};
  const VolumePath path = volumePath(part, ray, {0, 0.8});
  ASSERT_EQ(path.count, 1);
  const VolumeSegment& s = path.segments[0];
  for (const double t : {0.0, 0.4, 0.8}) {
    const double tau = t / 0.8 * s.length;
    EXPECT_NEAR(s.distanceAt(tau), t, 1e-6);
    const Triple<double> expected = texelAt(part, ray, t);
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(s.start[a] + tau * s.direction[a], expected[a], 1e-4);
  }
}

TEST(VolumePath, StaysFiniteForRaysAlongTheBordersOfRegions) {
  VolumePart part;
  part.contracted = true;
  for (const Vec3d& direction : {Vec3d(1, 1, 0), Vec3d(1, 1, 1), Vec3d(1, 0, 0), Vec3d(0, 0, -1)}) {
    for (const Vec3d& origin : {Vec3d(-5, -5, -5), Vec3d(0, 0, 0), Vec3d(-5, 1, 1), Vec3d(-7, -7, 0)}) {
      const VolumePath path = volumePath(part, {origin, direction.normalized()}, {0.05, 1e6});
      double covered = 0;
      for (int k = 0; k < path.count; ++k) {
        EXPECT_TRUE(std::isfinite(path.segments[k].length));
        EXPECT_NEAR(path.segments[k].direction[0] * path.segments[k].direction[0] +
                        path.segments[k].direction[1] * path.segments[k].direction[1] +
                        path.segments[k].direction[2] * path.segments[k].direction[2],
                    1, 1e-5);
        covered = path.segments[k].distanceAt(path.segments[k].length);
      }
      EXPECT_GT(covered, 1e4);
    }
  }
}

TEST(VolumePath, IsWithinWhatThePartOwnsAndItsDomain) {
  VolumePart part;
  part.low = {-0.5f, -1, -3};
  part.high = {0.5f, 1, 3};
  const SceneRay across{Vec3d(-3, 0, 0), Vec3d::UnitX()}, up{Vec3d(0, 0, -3), Vec3d::UnitZ()};
  EXPECT_NEAR(ownedRange(part, across, {0, 100}).near, 2.5, 1e-12);
  EXPECT_NEAR(ownedRange(part, across, {0, 100}).far, 3.5, 1e-12);
  EXPECT_NEAR(ownedRange(part, up, {0, 100}).near, 2, 1e-12);  // nothing of a bounded part lies outside its domain
  EXPECT_NEAR(ownedRange(part, up, {0, 100}).far, 4, 1e-12);
  part.contracted = true;
  part.high[2] = INFINITY;
  EXPECT_NEAR(ownedRange(part, up, {0, 100}).near, 0, 1e-12);
  EXPECT_NEAR(ownedRange(part, up, {0, 100}).far, 100, 1e-12);
  EXPECT_TRUE(ownedRange(part, {Vec3d(0.7, 0, 0), Vec3d::UnitZ()}, {0, 100}).empty());
}

}  // namespace
}  // namespace tessera
