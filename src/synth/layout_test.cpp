#include "synth/layout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/threads.h"
#include "synth/city_scene.h"
#include "synth/flights.h"

namespace tessera {
namespace {

TEST(Layout, IsAFunctionOfSizeAndSeed) {
  const CityLayout a = planCity(2, 2, 7), b = planCity(2, 2, 7), c = planCity(2, 2, 8);
  ASSERT_EQ(a.buildings.size(), b.buildings.size());
  for (size_t i = 0; i < a.buildings.size(); ++i) {
    EXPECT_EQ(a.buildings[i].centre, b.buildings[i].centre);
    EXPECT_EQ(a.buildings[i].seed, b.buildings[i].seed);
  }
  EXPECT_NE(a.area.width(), c.area.width());
  EXPECT_NE(a.buildings.front().seed, c.buildings.front().seed);
}

TEST(Layout, HoldsAnyNumberOfBlocksThatDoNotOverlap) {
  for (const auto& [x, y] : {std::pair(1, 1), std::pair(3, 1), std::pair(4, 5)}) {
    const CityLayout city = planCity(x, y, 3);
    ASSERT_EQ(city.blocks.size(), static_cast<size_t>(x * y));
    for (size_t i = 0; i < city.blocks.size(); ++i) {
      const Vec2f c = city.blocks[i].area.centre();
      EXPECT_EQ(city.blockAt(c.x(), c.y()), &city.blocks[i]);
      EXPECT_GT(city.blocks[i].area.width(), 60);
      EXPECT_GT(city.area.inside(c.x(), c.y()), 30);
    }
  }
}

TEST(Layout, ShowsEveryKindOfBlockInFour) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    std::set<BlockKind> kinds;
    for (const Block& block : planCity(2, 2, seed).blocks) kinds.insert(block.kind);
    EXPECT_EQ(kinds.size(), 4u);
  }
}

TEST(Layout, KeepsCityBuildingsOffTheStreets) {
  const CityLayout city = planCity(3, 3, 5);
  for (const Building& b : city.buildings) {
    if (city.area.inside(b.centre.x(), b.centre.y()) < 0) continue;
    for (const Vec2f& corner : b.outline()) {
      const Block* block = city.blockAt(corner.x(), corner.y());
      ASSERT_NE(block, nullptr) << corner.transpose();
      EXPECT_GT(block->area.inside(corner.x(), corner.y()), 1);
    }
  }
}

TEST(Layout, PutsPondsBelowTheirShores) {
  for (const Block& block : planCity(2, 2, 11).blocks) {
    const CityLayout city = planCity(2, 2, 11);
    for (const Pond& pond : block.ponds) {
      EXPECT_LT(city.ground(pond.centre.x(), pond.centre.y()), pond.level - 0.5f);
      EXPECT_GT(city.ground(pond.centre.x() + 1.6f * pond.radiusX, pond.centre.y()), pond.level);
    }
  }
}

TEST(Flights, GiveExactlyThePhotosAskedFor) {
  const CityLayout city = planCity(2, 2, 1);
  const Camera camera = droneCamera(40, 30);
  for (int photos : {1, 2, 3, 7, 30, 72, 101})
    for (const std::vector<double>& altitudes : {std::vector<double>{80}, {60, 120}, {40, 70, 100}})
      EXPECT_EQ(planFlights(city, camera, {photos, altitudes, 1}).size(), static_cast<size_t>(photos));
}

// Returns where the ray through a pixel meets the ground.
Vec2d groundAt(const Station& station, const Camera& camera, double ground, const Vec2d& pixel) {
  const Vec3d ray = station.worldFromCamera.rotation * *camera.directionInCamera(pixel);
  const Vec3d eye = station.worldFromCamera.translation;
  return (eye + ray * ((ground - eye.z()) / ray.z())).head<2>();
}

TEST(Flights, OverlapInSurveysAsAskedFor) {
  const CityLayout city = planCity(2, 2, 1);
  const Camera camera = droneCamera(400, 300);
  const std::vector<Station> stations = planFlights(city, camera, {0, {60, 120}, 1, 0.75});
  const double ground = city.terrain(0, 0);
  int neighbours = 0;
  for (size_t i = 1; i < stations.size(); ++i) {
    const Station &a = stations[i - 1], &b = stations[i];
    if (a.flightNumber != b.flightNumber) continue;
    // Of all lines and turns: the next photo's middle lies a quarter of the picture away, as far as wind and hand
    // allow.
    const Vec2d middle = groundAt(b, camera, ground, {200, 150});
    const std::optional<Vec2d> pixel =
        camera.pixelFromCamera(a.worldFromCamera.inverse() * Vec3d(middle.x(), middle.y(), ground));
    ASSERT_TRUE(pixel);
    ++neighbours;
    EXPECT_LT(std::abs(pixel->x() - 200), 0.25 * 400 + 40) << i << ", " << b.flight;
    EXPECT_LT(std::abs(pixel->y() - 150), 0.25 * 300 + 40) << i << ", " << b.flight;
  }
  EXPECT_EQ(stations.back().flightNumber, 5) << "two nadir flights and four oblique ones";
  EXPECT_EQ(neighbours, static_cast<int>(stations.size()) - 6);
  EXPECT_GT(stations.size(), 200u);
  EXPECT_LT(stations.size(), 500u);
}

TEST(Flights, StayOutsideBuildingsAndHoldLevelAxes) {
  const CityLayout city = planCity(2, 2, 1);
  for (const Station& s : planFlights(city, droneCamera(40, 30), {60, {25, 60}, 1})) {
    const Vec3d x = s.worldFromCamera.translation;
    EXPECT_GT(x.z(), city.highestNear(static_cast<float>(x.x()), static_cast<float>(x.y()), 2) + 1);
    const Mat3d r = s.worldFromCamera.rotation;
    EXPECT_LT((r * r.transpose() - Mat3d::Identity()).norm(), 1e-12);
    EXPECT_GT(r.determinant(), 0.999);
    EXPECT_LT(r(2, 2), -0.15) << "the camera looks down";
    EXPECT_LT(std::abs(r(2, 0)), 0.05) << "its right hand lies level";
  }
}

// Places that a model is to learn must be seen from several sides.
TEST(Flights, SeeNearlyEveryOpenPlaceInAtLeastFivePhotos) {
  ThreadPool pool;
  const CityScene city(2, 2, 1, pool);
  const Camera camera = droneCamera(400, 300);
  const std::vector<Station> stations = planFlights(city.layout, camera, {72, {60, 120}, 1});
  const Rect area = city.layout.area.inset(5);
  int open = 0, covered = 0;
  for (float x = area.x0; x < area.x1; x += 6) {
    for (float y = area.y0; y < area.y1; y += 6) {
      const Vec3f place(x, y, city.layout.ground(x, y) + 0.1f);
      if (city.tracer->occluded({place, {0, 0, 1}})) continue;
      ++open;
      int seen = 0;
      for (const Station& s : stations) {
        const Vec3d inCamera = s.worldFromCamera.inverse() * place.cast<double>();
        const std::optional<Vec2d> pixel = camera.pixelFromCamera(inCamera);
        if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > 400 || pixel->y() > 300) continue;
        const Vec3f way = s.worldFromCamera.translation.cast<float>() - place;
        seen += city.tracer->occluded({place, way.normalized(), 0, way.norm()}) ? 0 : 1;
      }
      covered += seen >= 5 ? 1 : 0;
    }
  }
  EXPECT_GT(open, 400);
  EXPECT_GT(covered, 0.97 * open);
}

}  // namespace
}  // namespace tessera
