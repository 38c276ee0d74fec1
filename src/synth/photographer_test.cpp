#include "synth/photographer.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "synth/flights.h"

namespace tessera {
namespace {

constexpr double kDegree = 0.017453292519943295;

// One small city for all tests of this file: building it takes longer than photographing it.
const CityScene& city() {
  static ThreadPool pool(2);
  static const CityScene scene(1, 1, 4, pool);
  return scene;
}

Pose view(double x, double y, double z, double heading, double pitch) {
  return {cameraRotation(heading * kDegree, pitch * kDegree), {x, y, z}};
}

Vec3d pointAt(const Camera& camera, const Pose& pose, const ImageF& depth, int x, int y) {
  const Vec3d direction = *camera.directionInCamera({x + 0.5, y + 0.5});
  return pose * (direction * (*depth.at(x, y) / direction.z()));
}

TEST(Photographer, GivesTheSameBytesForAnyNumberOfThreads) {
  const LensTable lens(droneCamera(48, 36));
  const TrafficScene traffic(city(), 12);
  ThreadPool one(1), three(3);
  const Pose pose = view(10, -90, 70, 0, 45);
  const Exposed a = takePhoto({city(), &traffic}, lens, pose, {2, 0.3, 9}, one);
  const Exposed b = takePhoto({city(), &traffic}, lens, pose, {2, 0.3, 9}, three);
  EXPECT_EQ(a.colour.pixels, b.colour.pixels);
  EXPECT_EQ(a.depth.pixels, b.depth.pixels);
  EXPECT_EQ(a.mask.pixels, b.mask.pixels);
}

TEST(Photographer, LooksUpTheLensAsPreciselyAsItIsDefined) {
  const Camera camera = droneCamera(64, 48);
  const LensTable lens(camera);
  for (double y = 0.3; y < 48; y += 3.7) {
    for (double x = 0.1; x < 64; x += 4.3) {
      const Vec3d exact = *camera.directionInCamera({x, y});
      const Eigen::Vector2d slope = lens.slopeAt(x, y);
      EXPECT_LT((slope - Eigen::Vector2d(exact.x() / exact.z(), exact.y() / exact.z())).norm() * camera.focalX(), 2e-3);
    }
  }
}

TEST(Photographer, PutsDepthOfTwoPhotosOnTheSameSurfaces) {
  const Camera camera = droneCamera(120, 90);
  const LensTable lens(camera);
  ThreadPool pool(2);
  const Pose poseA = view(0, -70, 75, 0, 55), poseB = view(25, -60, 65, -20, 60);
  const Exposed a = takePhoto({city()}, lens, poseA, {1, 0, 1}, pool),
                b = takePhoto({city()}, lens, poseB, {1, 0, 1}, pool);
  int agree = 0, behind = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      if (*a.depth.at(x, y) <= 0) continue;
      const Vec3d inB = poseB.inverse() * pointAt(camera, poseA, a.depth, x, y);
      const std::optional<Vec2d> pixel = camera.pixelFromCamera(inB);
      if (!pixel) continue;
      const double fx = pixel->x() - 0.5, fy = pixel->y() - 0.5;
      const int ix = static_cast<int>(std::floor(fx)), iy = static_cast<int>(std::floor(fy));
      if (ix < 0 || iy < 0 || ix + 1 >= camera.width || iy + 1 >= camera.height) continue;
      double low = 1e9, high = 0, inverse = 0;
      for (int k = 0; k < 4; ++k) {
        const double z = *b.depth.at(ix + k % 2, iy + k / 2);
        low = std::min(low, z);
        high = std::max(high, z);
        inverse += (k % 2 != 0 ? fx - ix : 1 - fx + ix) * (k / 2 != 0 ? fy - iy : 1 - fy + iy) / z;
      }
      if (high > 1.03 * low || 1 / inverse < 0.99 * inB.z()) continue;  // at an edge, or hidden from B
      (1 / inverse < 1.01 * inB.z() ? agree : behind) += 1;
    }
  }
  EXPECT_GT(agree, 1500);
  EXPECT_LT(behind, 0.01 * agree) << "B looks through what A sees";
}

TEST(Photographer, MeasuresDepthAlongTheOpticalAxis) {
  const Camera camera = droneCamera(40, 30);
  ThreadPool pool(1);
  const Pose pose = view(0, 0, 400, 0, 90);
  const Exposed photo = takePhoto({city()}, LensTable(camera), pose, {1, 0, 1}, pool);
  for (const auto& [x, y] : {std::pair(0, 0), std::pair(39, 2), std::pair(3, 29)}) {
    const Vec3d point = pointAt(camera, pose, photo.depth, x, y);
    EXPECT_NEAR(*photo.depth.at(x, y), 400 - point.z(), 1e-3);
    EXPECT_NEAR(point.z(), city().layout.ground(static_cast<float>(point.x()), static_cast<float>(point.y())), 12);
  }
}

TEST(Photographer, ShowsSkyWithoutDepth) {
  ThreadPool pool(1);
  const Exposed photo = takePhoto({city()}, LensTable(droneCamera(24, 18)), view(0, 0, 150, 40, -30), {1, 0, 1}, pool);
  for (float depth : photo.depth.pixels) EXPECT_EQ(depth, 0);
  EXPECT_GT(photo.colour.at(12, 9)[2], photo.colour.at(12, 9)[0]) << "it is blue";
}

TEST(Photographer, MasksAllThatTrafficChanges) {
  const Camera camera = droneCamera(160, 120);
  const LensTable lens(camera);
  ThreadPool pool(2);
  const TrafficScene traffic(city(), 5);
  const Pose pose = view(0, -20, 90, 0, 80);
  const Exposed with = takePhoto({city(), &traffic}, lens, pose, {2, 0, 3}, pool),
                without = takePhoto({city()}, lens, pose, {2, 0, 3}, pool);
  int masked = 0, changed = 0, cars = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const bool differs = !std::equal(with.colour.at(x, y), with.colour.at(x, y) + 3, without.colour.at(x, y));
      if (*with.mask.at(x, y) == 0) {
        ++masked;
      } else {
        EXPECT_FALSE(differs) << x << ' ' << y;
        EXPECT_EQ(*with.depth.at(x, y), *without.depth.at(x, y));
      }
      changed += differs ? 1 : 0;
      cars += *with.depth.at(x, y) < *without.depth.at(x, y) - 0.3f ? 1 : 0;
    }
  }
  EXPECT_GT(cars, 20);
  EXPECT_GT(changed, 0.7 * masked) << "no more is masked than need be";
  EXPECT_LT(masked, 0.1 * camera.width * camera.height);
}

TEST(Photographer, MovesTrafficWithTime) {
  const TrafficScene a(city(), 5), b(city(), 6), again(city(), 5);
  ASSERT_EQ(a.mesh.positions.size(), b.mesh.positions.size());
  EXPECT_NE(a.mesh.positions.front(), b.mesh.positions.front());
  EXPECT_EQ(a.mesh.positions, again.mesh.positions);
}

TEST(Photographer, AppliesExposureAsAGainOfLinearLight) {
  const LensTable lens(droneCamera(40, 30));
  ThreadPool pool(2);
  const Pose pose = view(0, -60, 60, 0, 60);
  const Exposed plain = takePhoto({city()}, lens, pose, {2, 0, 3}, pool),
                darker = takePhoto({city()}, lens, pose, {2, -1, 3}, pool);
  const auto linear = [](uint8_t value) {
    const double v = value / 255.0;
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  };
  for (size_t i = 0; i < plain.colour.pixels.size(); i += 7)
    EXPECT_NEAR(linear(darker.colour.pixels[i]), 0.5 * linear(plain.colour.pixels[i]), 0.006);
}

TEST(Photographer, SeesWaterChangeWithTheViewpoint) {
  ThreadPool pool(2);
  const CityScene water(3, 1, 1, pool);
  const auto kindIsPark = [](const Block& block) { return block.kind == BlockKind::park; };
  const auto park = std::find_if(water.layout.blocks.begin(), water.layout.blocks.end(), kindIsPark);
  ASSERT_NE(park, water.layout.blocks.end());
  const Pond& pond = park->ponds.front();
  const auto brightness = [&](const Vec3f& from) {
    const Vec3f target(pond.centre.x(), pond.centre.y(), pond.level);
    return lightAlong(water, nullptr, {target + from, -from.normalized()}, 1e-3f, {0.5f, 0.5f}).radiance.z();
  };
  // Seen from above a pond is dark; at grazing angles it mirrors the sky on some sides and trees on others.
  float brightest = 0, darkest = 1e9f;
  for (float angle = 0; angle < 6.2f; angle += 0.785f) {
    const float b = brightness({0.7f * pond.radiusY * std::cos(angle), 0.7f * pond.radiusY * std::sin(angle), 1.2f});
    brightest = std::max(brightest, b);
    darkest = std::min(darkest, b);
  }
  EXPECT_GT(brightest, 3 * brightness({0, 0, 30}));
  EXPECT_GT(brightest, 3 * darkest);
}

}  // namespace
}  // namespace tessera
