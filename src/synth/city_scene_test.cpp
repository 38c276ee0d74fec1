// What makes the city hard for a radiance field: wires, partly transparent foliage, and glass whose colour depends on
// the viewing direction.
#include "synth/city_scene.h"

#include <gtest/gtest.h>

#include <map>
#include <numbers>

#include "base/threads.h"
#include "synth/surface.h"

namespace tessera {
namespace {

TEST(CityScene, HangsWiresBetweenWiredPoles) {
  const CityLayout city = planCity(1, 1, 3);
  const SurfaceMesh mesh = buildCity(city);
  const TraceDevice device;
  const TraceScene tracer(device, mesh);
  const auto arm = [&](const Pole& pole) {
    return Vec3f(pole.foot.x(), pole.foot.y(), city.ground(pole.foot.x(), pole.foot.y()) + pole.height - 0.5f);
  };
  int spans = 0;
  for (size_t i = 0; i + 1 < city.poles.size(); ++i) {
    const Vec3f from = arm(city.poles[i]), to = arm(city.poles[i + 1]);
    const Vec3f across = Vec3f(from.y() - to.y(), to.x() - from.x(), 0).normalized();
    for (float side : {-1.f, 0.f, 1.f}) {
      // At the middle of a straight piece, 0.88 m below the line between the insulators on the arms.
      const Vec3f wire = mix(from, to, 0.45f) + across * side + Vec3f(0, 0, 0.2f - 0.882f);
      const auto hit = tracer.intersect({wire + Vec3f(0, 0, 0.3f), {0, 0, -1}, 0, 0.6f});
      if (!city.poles[i].wires) {
        EXPECT_FALSE(hit && hit->material == Material::wire) << "after the last pole of a line";
        continue;
      }
      ASSERT_TRUE(hit) << "pole " << i;
      EXPECT_EQ(hit->material, Material::wire) << "pole " << i;
      EXPECT_NEAR(hit->position.z(), wire.z(), 0.05f) << "pole " << i;
      // The wire is thin: 10 cm beside it there is air.
      EXPECT_FALSE(tracer.occluded({wire + across * 0.1f + Vec3f(0, 0, 0.3f), {0, 0, -1}, 0, 0.6f})) << "pole " << i;
    }
    spans += city.poles[i].wires ? 1 : 0;
  }
  EXPECT_GT(spans, 8);
}

TEST(CityScene, TellsWhatThingASurfaceBelongsTo) {
  const CityLayout city = planCity(2, 2, 3);
  const SurfaceMesh mesh = buildCity(city);
  const TraceDevice device;
  const TraceScene tracer(device, mesh);
  // The share of rays that end on a surface of the class.
  std::map<SurfaceClass, std::pair<int, int>> shares;
  const auto look = [&](SurfaceClass expected, const Vec3f& from, const Vec3f& direction, float far) {
    auto& [hits, rays] = shares[expected];
    const auto hit = tracer.intersect({from, direction, 0, far});
    hits += hit && classOfMaterial(hit->material) == expected ? 1 : 0;
    ++rays;
  };
  const auto lookDown = [&](SurfaceClass expected, const Vec2f& at, float height) {
    look(expected, {at.x(), at.y(), city.ground(at.x(), at.y()) + height}, {0, 0, -1}, height + 5);
  };
  for (const Building& building : city.buildings) {
    if (city.area.inside(building.centre.x(), building.centre.y()) < 0) continue;
    lookDown(SurfaceClass::roof, building.place(0.3f * building.halfX, 0.3f * building.halfY), 200);
    const std::vector<Vec2f> outline = building.outline();
    const Vec2f along = outline[1] - outline[0], middle = outline[0] + 0.4f * along;
    const Vec3f outward = Vec3f(along.y(), -along.x(), 0).normalized();
    look(SurfaceClass::facade, Vec3f(middle.x(), middle.y(), building.base + 0.5f * building.height()) + outward,
         -outward, 2);
  }
  for (const Tree& tree : city.trees) lookDown(SurfaceClass::tree, tree.foot, tree.height + 1);
  for (const Block& block : city.blocks)
    for (const Pond& pond : block.ponds) lookDown(SurfaceClass::water, pond.centre, 3);
  for (const Pole& lamp : city.lamps) lookDown(SurfaceClass::wire, lamp.foot, lamp.height + 1);
  for (const Pole& pole : city.poles) lookDown(SurfaceClass::wire, pole.foot, pole.height + 1);
  for (const ParkedCar& car : city.parkedCars) lookDown(SurfaceClass::car, car.centre, 3);
  for (const Street& street : city.alongY)
    for (int i = -10; i <= 10; ++i)
      lookDown(SurfaceClass::ground, {street.centre, 0.04f * static_cast<float>(i) * city.area.depth()}, 2);
  EXPECT_EQ(shares.size(), size_t{kSurfaceClasses});
  for (const auto& [expected, share] : shares) {
    EXPECT_GT(share.second, 0);
    EXPECT_GT(share.first, 0.8 * share.second) << "class " << static_cast<int>(expected);
  }
}

// Returns horizontal rays through the inside of the crown, from all around.
std::vector<Ray> raysThrough(const Tree& tree) {
  std::vector<Ray> rays;
  for (int turn = 0; turn < 6; ++turn) {
    const float angle = static_cast<float>(turn) * std::numbers::pi_v<float> / 3;
    const Vec3f direction(std::cos(angle), std::sin(angle), 0), aside(-direction.y(), direction.x(), 0);
    for (int row = 0; row < 16; ++row) {
      for (int column = 0; column < 16; ++column) {
        const float up = tree.height * mix(0.45f, 0.8f, (static_cast<float>(row) + 0.5f) / 16);
        const float sideways = tree.radius * mix(-0.4f, 0.4f, (static_cast<float>(column) + 0.5f) / 16);
        rays.push_back({aside * sideways + Vec3f(0, 0, up) - direction * 30.f, direction, 0, 60});
      }
    }
  }
  return rays;
}

TEST(CityScene, LetsSomeRaysThroughTheCrownsOfTrees) {
  const TraceDevice device;
  for (bool conifer : {false, true}) {
    const Tree tree{.height = 9, .radius = 3, .conifer = conifer, .seed = 5};
    SurfaceMesh mesh, opaque;
    addTree(tree, 0, mesh);
    addTree(tree, 0, opaque);
    for (size_t card = 0; card < opaque.leafObjects.size(); ++card) {
      const Vec3f* corner = &opaque.leafCorners[4 * card];
      opaque.addQuad(corner[0], corner[1], corner[2], corner[3], Material::leaf, opaque.leafObjects[card]);
    }
    const TraceScene tracer(device, mesh), opaqueTracer(device, opaque);
    const std::vector<Ray> rays = raysThrough(tree);
    size_t leaves = 0, stopped = 0, stoppedByCards = 0;
    for (const Ray& ray : rays) {
      const auto hit = tracer.intersect(ray);
      EXPECT_EQ(hit.has_value(), tracer.occluded(ray)) << "its shadow has the same holes";
      stopped += hit ? 1 : 0;
      leaves += hit && hit->material == Material::leaf ? 1 : 0;
      stoppedByCards += opaqueTracer.occluded(ray) ? 1 : 0;
    }
    const double share = static_cast<double>(stopped) / static_cast<double>(rays.size());
    EXPECT_GT(share, 0.3) << "conifer: " << conifer;
    EXPECT_LT(share, 0.97) << "conifer: " << conifer;
    EXPECT_GT(leaves, stopped / 2);
    EXPECT_LT(rays.size() - stoppedByCards, (rays.size() - stopped) / 2) << "most holes are cut out of the cards";
  }
}

// Returns how much the light from a place changes with the side from which it is seen; nothing if something else is in
// the way. Distance and footprint are those of the other view, so that only the direction differs.
std::optional<float> changeWithDirection(const CityScene& city, const Vec3f& place, const Vec3f& a, const Vec3f& b) {
  constexpr float kAway = 6;
  Vec3f light[2];
  for (int i = 0; i < 2; ++i) {
    const Vec3f towards = i == 0 ? a : b;
    const Ray ray{place + towards * kAway, -towards};
    const auto hit = firstHit(city, nullptr, ray);
    if (!hit || (hit->position - place).norm() > 0.02f) return std::nullopt;
    light[i] = lightAlong(city, nullptr, ray, 0, {0.5f, 0.5f}).radiance;
  }
  return (light[0] - light[1]).norm() / std::max(light[0].norm(), light[1].norm());
}

TEST(CityScene, ShowsGlassTowersDifferentlyFromDifferentSides) {
  ThreadPool pool;
  const CityScene city(2, 1, 3, pool);  // one of the two blocks has towers
  int glass = 0, changed = 0, walls = 0, steady = 0;
  for (const Building& building : city.layout.buildings) {
    const bool curtain = building.style == FacadeStyle::curtain;
    if (city.layout.area.inside(building.centre.x(), building.centre.y()) < 0) continue;
    const std::vector<Vec2f> outline = building.outline();
    for (size_t side = 0; side < outline.size(); ++side) {
      const Vec2f from = outline[side], to = outline[(side + 1) % outline.size()];
      const Vec3f along = Vec3f(to.x() - from.x(), to.y() - from.y(), 0).normalized();
      const Vec3f outward(along.y(), -along.x(), 0);
      for (int i = 0; i < 40; ++i) {
        const Vec2f foot = mix(from, to, (static_cast<float>(i % 8) + 0.37f) / 8);
        const float up = building.height() * (0.15f + 0.16f * static_cast<float>(i / 8));
        const Vec3f place(foot.x(), foot.y(), building.base + up);
        const auto hit = firstHit(city, nullptr, {place + outward, -outward, 0, 2});
        if (!hit || hit->material != Material::facade) continue;
        const Surface surface = surfaceAt(city.layout, *hit, 0);
        const auto change = changeWithDirection(city, hit->position, (outward + along * 0.3f).normalized(),
                                                (outward - along * 2 + Vec3f(0, 0, 0.5f)).normalized());
        if (!change) continue;
        if (surface.gloss == 0) {
          ++walls;
          steady += *change < 1e-3f ? 1 : 0;
        } else if (curtain) {
          ++glass;
          changed += *change > 0.1f ? 1 : 0;
        }
      }
    }
  }
  EXPECT_GT(walls, 50);
  EXPECT_GT(steady, 0.95 * walls) << "but at the edges of bricks and shadows";
  EXPECT_GT(glass, 50);
  EXPECT_GT(changed, 0.7 * glass);
}

}  // namespace
}  // namespace tessera
